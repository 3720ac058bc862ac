import { expect, it } from "vitest";
import { createStampTable, findMark, noteMark } from "../../src/gate/stamp_table";
import type { FrameMark } from "../../src/gate/gate_counters";

function markOf(stamp: number | null): FrameMark {
  return { stamp, capturedMs: null };
}

it("tells a frame without a stamp from a frame not seen", () => {
  const table = createStampTable(4);
  noteMark(table, 90, markOf(null));
  noteMark(table, 91, markOf(7));
  expect(findMark(table, 90)).toEqual(markOf(null));
  expect(findMark(table, 91)).toEqual(markOf(7));
  expect(findMark(table, 92)).toBeUndefined();
});

it("forgets the oldest beyond its limit", () => {
  const table = createStampTable(3);
  for (let index = 1; index <= 5; index++) noteMark(table, index, markOf(index));
  expect([...table.marks.keys()]).toEqual([3, 4, 5]);
});

it("a timestamp that comes again counts as new", () => {
  const table = createStampTable(2);
  noteMark(table, 1, markOf(1));
  noteMark(table, 2, markOf(2));
  noteMark(table, 1, markOf(9));
  noteMark(table, 3, markOf(3));
  expect(findMark(table, 1)).toEqual(markOf(9));
  expect(findMark(table, 2)).toBeUndefined();
});
