import { expect, it } from "vitest";
import { createStampBook, findStamp, noteStamp } from "../../src/core/stamp_book";

it("tells a frame without a stamp from a frame not seen", () => {
  const book = createStampBook(4);
  noteStamp(book, 90, null);
  noteStamp(book, 91, 7);
  expect(findStamp(book, 90)).toBeNull();
  expect(findStamp(book, 91)).toBe(7);
  expect(findStamp(book, 92)).toBeUndefined();
});

it("forgets the oldest beyond its limit", () => {
  const book = createStampBook(3);
  for (let index = 1; index <= 5; index++) noteStamp(book, index, index);
  expect([...book.stamps.keys()]).toEqual([3, 4, 5]);
});

it("a timestamp that comes again counts as new", () => {
  const book = createStampBook(2);
  noteStamp(book, 1, 1);
  noteStamp(book, 2, 2);
  noteStamp(book, 1, 9);
  noteStamp(book, 3, 3);
  expect(findStamp(book, 1)).toBe(9);
  expect(findStamp(book, 2)).toBeUndefined();
});
