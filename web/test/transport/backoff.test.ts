import { expect, it } from "vitest";
import { createBackoff, nextWait, noteLifetime } from "../../src/transport/backoff";

it("doubles up to the cap", () => {
  const backoff = createBackoff(300, 5000, 5000);
  expect(Array.from({ length: 7 }, () => nextWait(backoff, 0.5))).toEqual([
    300, 600, 1200, 2400, 4800, 5000, 5000,
  ]);
});

it("varies by a quarter either way and never beyond the cap", () => {
  expect(nextWait(createBackoff(1000), 0)).toBe(750);
  expect(nextWait(createBackoff(1000), 1)).toBe(1250);
  expect(nextWait(createBackoff(5000, 5000), 1)).toBe(5000);
});

it("starts over only after a healthy spell", () => {
  const backoff = createBackoff(300, 5000, 5000);
  nextWait(backoff, 0.5);
  noteLifetime(backoff, 4999);
  expect(nextWait(backoff, 0.5)).toBe(600);
  noteLifetime(backoff, 5000);
  expect(nextWait(backoff, 0.5)).toBe(300);
});
