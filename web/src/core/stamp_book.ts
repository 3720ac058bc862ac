/** Which RTP timestamp belongs to which event: the newest `limit` entries of one receiver. */
export interface StampBook {
  readonly limit: number; // 512
  readonly stamps: Map<number, number | null>; // in order of arrival; null: the frame came without a stamp
}

export function createStampBook(limit: number): StampBook {
  return { limit, stamps: new Map() };
}

export function noteStamp(book: StampBook, rtpTimestamp: number, stamp: number | null): void {
  book.stamps.delete(rtpTimestamp);
  book.stamps.set(rtpTimestamp, stamp);
  for (const oldest of book.stamps.keys()) {
    if (book.stamps.size <= book.limit) break;
    book.stamps.delete(oldest);
  }
}

/** The stamp, null when the frame has none, undefined while nothing is known of the frame. */
export function findStamp(book: StampBook, rtpTimestamp: number): number | null | undefined {
  return book.stamps.get(rtpTimestamp);
}
