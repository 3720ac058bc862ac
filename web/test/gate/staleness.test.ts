import { expect, it } from "vitest";
import { gapOnScreen, staleness } from "../../src/gate/staleness";

const context = { feedback: 10, tolerance: 4, gate: "event", wallMs: 0 } as const;

it("a picture within tolerance is not stale", () => expect(staleness(6, 0, 0, context, 100)).toBeNull());

it("says how many events the picture is behind", () => {
  expect(staleness(5, 0, 0, context, 100)).toBe("5 events behind");
  expect(staleness(9, 0, 0, { ...context, tolerance: 0 }, 100)).toBe("1 event behind");
});

it("says when pictures no longer come", () => {
  expect(staleness(10, 0, 0, context, 3100)).toBe("No picture for 3 s");
  expect(staleness(10, 0, null, context, 1300)).toBe("No picture for 1 s");
});

it("says that the first picture is awaited", () => {
  expect(staleness(null, null, null, context, 0)).toBe("Waiting for the first picture");
});

it("judges no gap while the gate is off or nothing is known", () => {
  expect(staleness(1, 0, 0, { ...context, gate: "off" }, 0)).toBeNull();
  expect(staleness(1, 0, 0, { ...context, feedback: null }, 0)).toBeNull();
  expect(staleness(null, 0, 0, context, 0)).toBeNull();
});

it("knows how far the picture on screen is behind now, not when it was drawn", () => {
  expect(gapOnScreen(9, { feedback: 10 })).toBe(1);
  expect(gapOnScreen(9, { feedback: 18 })).toBe(9);
  expect(gapOnScreen(null, { feedback: 18 })).toBeNull();
  expect(gapOnScreen(9, { feedback: null })).toBeNull();
});
