import { describe, expect, it } from "vitest";

import { pressedStopLabel, restingStopLabel } from "../../src/stop/stop_labels";

describe("the words of a STOP button at rest", () => {
  it.each([
    [true, true, false, "robot is stopped"],
    [true, false, false, "stopped when last heard"],
    [true, false, true, "stopped when last heard"],
    [false, true, false, "Esc"],
    [false, false, true, ""],
  ])("stopped %s, heard %s, touch %s", (stopped, heard, touch, words) => {
    expect(restingStopLabel(stopped, heard, touch)).toBe(words);
  });
});

describe("the STOP button after a press", () => {
  it("says of a confirmation that it was before the console or the robot fell silent", () => {
    expect(pressedStopLabel("confirmed", true)).toBe("the robot confirmed it");
    expect(pressedStopLabel("confirmed", false)).toBe("was confirmed; silent now");
  });

  it("says everything else whether the robot is heard or not", () => {
    for (const fate of ["sending", "not_kept", "waiting", "unconfirmed", "silenced"] as const)
      expect(pressedStopLabel(fate, false)).toBe(pressedStopLabel(fate, true));
  });
});
