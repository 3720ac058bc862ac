import type { FrameMark } from "./gate_counters";

/** What the frame of each RTP timestamp said: the newest `limit` entries of one receiver. */
export interface StampTable {
  readonly limit: number; // 512
  readonly marks: Map<number, FrameMark>; // in order of arrival
}

export function createStampTable(limit: number): StampTable {
  return { limit, marks: new Map() };
}

export function noteMark(book: StampTable, rtpTimestamp: number, mark: FrameMark): void {
  book.marks.delete(rtpTimestamp);
  book.marks.set(rtpTimestamp, mark);
  for (const oldest of book.marks.keys()) {
    if (book.marks.size <= book.limit) break;
    book.marks.delete(oldest);
  }
}

/** Undefined while nothing is known of the frame. */
export function findMark(book: StampTable, rtpTimestamp: number): FrameMark | undefined {
  return book.marks.get(rtpTimestamp);
}
