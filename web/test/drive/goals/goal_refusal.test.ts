import { describe, expect, it } from "vitest";
import { goalRefusalWords, refusedAxis, shownRefusal } from "../../../src/drive/goals/goal_refusal";
import { descriptionOf, goalAxisOf } from "../../messages";

const robot = descriptionOf([goalAxisOf("arm.elbow", { label: "Elbow" })]);
const jump = { reason: "jump", detail: "arm.elbow: 0.7 rad from where it is", atMs: 1000 } as const;

describe("a refused goal", () => {
  it("is shown for a while after the newest one", () => {
    expect(shownRefusal(null, 0)).toBeNull();
    expect(shownRefusal(jump, 2000)).toBe(jump);
    expect(shownRefusal(jump, 4000)).toBeNull();
  });

  it("names the axis that the robot names, and says what to do", () => {
    expect(refusedAxis(jump, robot)?.label).toBe("Elbow");
    expect(refusedAxis({ ...jump, detail: "" }, robot)).toBeNull();
    expect(refusedAxis(jump, null)).toBeNull();
    expect(goalRefusalWords(jump, robot)).toMatch(/^Refused: Elbow is too far from its goal\..*begin again/);
    expect(goalRefusalWords({ ...jump, detail: "?" }, robot)).toMatch(/^Refused: A joint/);
    expect(goalRefusalWords({ ...jump, reason: "conflict" }, robot)).toMatch(/Let go of one/);
  });
});
