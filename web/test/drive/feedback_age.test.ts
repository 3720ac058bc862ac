import { expect, it } from "vitest";
import { ageLabel, feedbackAge } from "../../src/drive/feedback_age";

it("what was measured a moment ago is present, later it has an age", () => {
  expect(feedbackAge(null, 10_000)).toBeNull();
  expect(feedbackAge(9000, 10_000)).toBeNull();
  expect(feedbackAge(8500, 10_000)).toBe("1 s");
  expect(feedbackAge(1000, 10_000)).toBe("9 s");
});

it("ages are told in seconds, then in minutes", () => {
  expect([999, 1000, 99_000, 180_000].map(ageLabel)).toEqual(["0 s", "1 s", "99 s", "3 min"]);
});
