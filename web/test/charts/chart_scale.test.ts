import { expect, it } from "vitest";
import { gapRange, held, redrawMs, valueRange } from "../../src/charts/chart_scale";

it("scales of values hold them with a margin, and zero where it is wanted", () => {
  expect(valueRange(null, null, true)).toEqual([0, 1]);
  expect(valueRange(100, 200, true)).toEqual([0, 216]);
  expect(valueRange(-5, 0, true)).toEqual([-5, 1]);
  expect(valueRange(100, 200, false)).toEqual([94, 206]);
  expect(valueRange(7, 7, false)).toEqual([6, 8]);
});

it("the scale of gaps shows room on both sides of the tolerance", () => {
  expect(gapRange(null, null)).toEqual([-1, 1]);
  expect(gapRange(-4, 4)).toEqual([-5, 5]);
  expect(gapRange(-6, 100)).toEqual([-7, 115]);
});

it("a value is carried over few holes and not over many", () => {
  expect(held([null, 1, null, null, null, 2, null], 2)).toEqual([null, 1, 1, 1, null, 2, 2]);
});

it("long times are drawn anew less often", () => {
  expect([30, 120, 600].map(redrawMs)).toEqual([200, 500, 1000]);
});
