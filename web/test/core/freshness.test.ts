import { expect, it } from "vitest";
import { ageWords, resumeWords, staleAge } from "../../src/core/freshness";

it("what was measured a moment ago is present, later it has an age", () => {
  expect(staleAge(null, 10_000)).toBeNull();
  expect(staleAge(9000, 10_000)).toBeNull();
  expect(staleAge(8500, 10_000)).toBe("1 s");
  expect(staleAge(1000, 10_000)).toBe("9 s");
});

it("ages are told in seconds, then in minutes", () => {
  expect([999, 1000, 99_000, 180_000].map(ageWords)).toEqual(["0 s", "1 s", "99 s", "3 min"]);
});

it("every step back to a connection has its own words", () => {
  const phases = ["asking", "hoping", "restarting", "over"] as const;
  expect(new Set(phases.map(resumeWords)).size).toBe(phases.length);
  expect([resumeWords("live"), resumeWords("moving")]).toEqual([
    resumeWords("asking"),
    resumeWords("restarting"),
  ]);
});
