import { describe, expect, it } from "vitest";
import { commandSummary, pictureSummary } from "../../src/charts/way_summary";
import { TraceBook } from "../../src/engine/trace_book";

function bookOf(decodes: readonly number[]): TraceBook {
  const book = new TraceBook();
  decodes.forEach((decode_ms, at) => {
    const spans = { camera_wait_ms: 50, capture_ms: 1, decode_ms };
    book.pictures.add({ stream: "front", stamp: at + 1, atMs: 1000 * (at + 1), spans });
  });
  return book;
}

describe("a stacked bar", () => {
  it("has every part that was measured, in the order of the way, as it is in the middle half", () => {
    const summary = pictureSummary(bookOf([0, 2, 4, 40]), "front", 0, 9000);
    expect(summary?.parts.map(({ name, ms }) => [name, ms])).toEqual([
      ["capture_ms", 1],
      ["decode_ms", 3],
    ]);
    expect(summary?.totalMs).toBe(4);
  });

  it("is of those alone that have a remainder, where some have one", () => {
    const book = bookOf([2, 4, 40]);
    const spans = { capture_ms: 1, decode_ms: 5, between_ms: 7 };
    book.pictures.add({ stream: "front", stamp: 4, atMs: 4000, spans });
    const summary = pictureSummary(book, "front", 0, 9000);
    expect([summary?.count, summary?.totalMs, summary?.hasRemainder]).toEqual([1, 13, true]);
  });

  it("adds up to the way, also where a part is rare: what was not measured took no time", () => {
    const book = new TraceBook();
    for (const input_ms of [undefined, 8, undefined, undefined])
      book.commands.add({
        event: 1,
        atMs: 1000,
        totalMs: 5,
        spans: input_ms === undefined ? { between_ms: 5 } : { input_ms, between_ms: 5 },
      });
    const summary = commandSummary(book, 0, 9000);
    expect(summary?.parts.map(({ name, p95Ms }) => [name, p95Ms])).toEqual([
      ["input_ms", 8],
      ["between_ms", 5],
    ]);
    expect(summary?.totalMs).toBe(5);
  });

  it("names the slowest event and its longest part", () => {
    const summary = pictureSummary(bookOf([2, 40, 3]), "front", 0, 9000);
    expect(summary?.slowest).toEqual({ event: 2, totalMs: 41, name: "decode_ms", ms: 40 });
  });

  it("covers the time that is shown alone, and one camera alone", () => {
    expect(pictureSummary(bookOf([2, 3, 40]), "front", 1500, 2500)?.count).toBe(1);
    expect(pictureSummary(bookOf([2]), "overview", 0, 9000)).toBeNull();
  });

  it("does not exist without a trace", () => {
    expect(pictureSummary(new TraceBook(), "front", 0, 9000)).toBeNull();
    expect(commandSummary(new TraceBook(), 0, 9000)).toBeNull();
  });
});
