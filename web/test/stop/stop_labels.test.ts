import { describe, expect, it } from "vitest";

import { restingStopLabel } from "../../src/stop/stop_labels";

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
