import { expect, it } from "vitest";
import { warningSeconds, warningLabel } from "../../../src/drive/labels/start_warning";
import { feedbackOf } from "../../messages";

it("the warning before motion counts down between two feedbacks and ends", () => {
  const feedback = feedbackOf(1, { warning: 3 });
  expect([1000, 1001, 2500, 4000, 9000].map((now) => warningSeconds(feedback, 1000, now))).toEqual([
    3, 3, 2, 0, 0,
  ]);
  expect(warningLabel(3)).toContain("3 s");
});

it("nothing is warned of while nothing is known or the robot does not warn", () => {
  expect(warningSeconds(null, 0, 0)).toBe(0);
  expect(warningSeconds(feedbackOf(1, { warning: 3 }), null, 0)).toBe(0);
  expect(warningSeconds(feedbackOf(1), 0, 0)).toBe(0);
});
