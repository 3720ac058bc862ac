const LOST_AFTER_MS = 1000;

/** Pings that are out: the round trip, and which of them were lost. */
export interface PingLedger {
  readonly out: Map<number, number>; // id -> when it was sent, oldest first
  nextId: number;
  lookedMs: number; // when losses were last asked for; -Infinity before the first time
}

export function createPingLedger(): PingLedger {
  return { out: new Map(), nextId: 1, lookedMs: -Infinity };
}

/** The id of the ping to send now. */
export function sendPing(ledger: PingLedger, now: number): number {
  const id = ledger.nextId++;
  ledger.out.set(id, now);
  return id;
}

/** The round trip; null for a pong that answers nothing. */
export function pingAnswered(ledger: PingLedger, id: number, now: number): number | null {
  const sent = ledger.out.get(id);
  ledger.out.delete(id);
  return sent === undefined ? null : now - sent;
}

/**
 * How many pings have become lost since the last call. A page that was held up has answers waiting that it has not
 * read: what is overdue then is forgotten and not counted.
 */
export function lostPings(ledger: PingLedger, now: number): number {
  const wasHeldUp = now - ledger.lookedMs > LOST_AFTER_MS;
  ledger.lookedMs = now;
  let count = 0;
  for (const [id, sent] of ledger.out) {
    if (sent >= now - LOST_AFTER_MS) break;
    ledger.out.delete(id);
    count += 1;
  }
  return wasHeldUp ? 0 : count;
}
