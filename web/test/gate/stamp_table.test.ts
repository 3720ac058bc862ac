import { expect, it } from "vitest";
import { createStampTable, findMark, noteMark } from "../../src/gate/stamp_table";
import type { FrameMark } from "../../src/gate/gate_counters";

function markOf(stamp: number | null): FrameMark {
  return { stamp, capturedMs: null };
}

it("tells a frame without a stamp from a frame not seen", () => {
  const book = createStampTable(4);
  noteMark(book, 90, markOf(null));
  noteMark(book, 91, markOf(7));
  expect(findMark(book, 90)).toEqual(markOf(null));
  expect(findMark(book, 91)).toEqual(markOf(7));
  expect(findMark(book, 92)).toBeUndefined();
});

it("forgets the oldest beyond its limit", () => {
  const book = createStampTable(3);
  for (let index = 1; index <= 5; index++) noteMark(book, index, markOf(index));
  expect([...book.marks.keys()]).toEqual([3, 4, 5]);
});

it("a timestamp that comes again counts as new", () => {
  const book = createStampTable(2);
  noteMark(book, 1, markOf(1));
  noteMark(book, 2, markOf(2));
  noteMark(book, 1, markOf(9));
  noteMark(book, 3, markOf(3));
  expect(findMark(book, 1)).toEqual(markOf(9));
  expect(findMark(book, 2)).toBeUndefined();
});
