import type { FrameMark } from "./gate_counters";

/** What the frame of each RTP timestamp said: the newest `limit` entries of one receiver. */
export interface StampTable {
  readonly limit: number; // 512
  readonly marks: Map<number, FrameMark>; // in order of arrival
}

export function createStampTable(limit: number): StampTable {
  return { limit, marks: new Map() };
}

export function noteMark(table: StampTable, rtpTimestamp: number, mark: FrameMark): void {
  table.marks.delete(rtpTimestamp);
  table.marks.set(rtpTimestamp, mark);
  for (const oldest of table.marks.keys()) {
    if (table.marks.size <= table.limit) break;
    table.marks.delete(oldest);
  }
}

/** Undefined while nothing is known of the frame. */
export function findMark(table: StampTable, rtpTimestamp: number): FrameMark | undefined {
  return table.marks.get(rtpTimestamp);
}
