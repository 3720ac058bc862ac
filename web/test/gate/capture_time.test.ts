import { expect, it } from "vitest";
import { eventOfOffset } from "../../src/gate/capture_time";
import { MAX_EVENT } from "../../src/gate/serial";

it("whole seconds of the offset are the event", () => {
  expect(eventOfOffset(5000)).toBe(5);
  expect(eventOfOffset(MAX_EVENT * 1000)).toBe(MAX_EVENT);
});

it("an offset that rounding moved by less than a millisecond still counts", () => {
  expect(eventOfOffset(4999.6)).toBe(5);
});

it.each([undefined, 0, 5400, -3000, NaN, Infinity, 2 ** 31 * 1000])("%s is no event", (offset) => {
  expect(eventOfOffset(offset)).toBeNull();
});
