import { expect, it } from "vitest";
import { eventAfter, eventGap, isEvent, isNewer, MAX_EVENT } from "../../src/gate/serial";

it("the event after the largest is 1, never 0", () => {
  expect(eventAfter(MAX_EVENT)).toBe(1);
  expect(eventAfter(1)).toBe(2);
});

it("gaps count across the wrap, both ways", () => {
  expect(eventGap(1, MAX_EVENT)).toBe(2);
  expect(eventGap(MAX_EVENT, 1)).toBe(-2);
  expect(eventGap(7, 7)).toBe(0);
});

it("newer is judged in serial arithmetic", () => {
  expect(isNewer(1, MAX_EVENT)).toBe(true);
  expect(isNewer(MAX_EVENT, 1)).toBe(false);
  expect(isNewer(5, 5)).toBe(false);
});

it.each([0, -1, 1.5, NaN, Infinity, 2 ** 31])("%s is no event", (value) =>
  expect(isEvent(value)).toBe(false),
);

it.each([1, 5, MAX_EVENT])("%s is an event", (value) => expect(isEvent(value)).toBe(true));
