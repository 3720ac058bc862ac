const LOST_AFTER_MS = 1000; // at least
const LOST_TRIPS = 2; // round trips after which a ping counts as lost on a long path
const LOST_UNKNOWN_MS = 3000; // before the first answer
const FORGOTTEN_MS = 10_000; // until then a late answer still tells the round trip

/** Pings that are out: the round trip, and which of them were lost. */
export interface PingLedger {
  readonly out: Map<number, number>; // id -> when it was sent, oldest first
  nextId: number;
  roundTripMs: number | null; // of the newest answer; null before the first
  countedId: number; // pings up to this one were counted, if lost
  lookedMs: number; // when losses were last asked for; -Infinity before the first time
}

export function createPingLedger(): PingLedger {
  return { out: new Map(), nextId: 1, roundTripMs: null, countedId: 0, lookedMs: -Infinity };
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
  if (sent === undefined) return null;
  ledger.roundTripMs = now - sent;
  return ledger.roundTripMs;
}

/**
 * How many pings have become lost since the last call. A page that was held up has answers waiting that it has not
 * read: what is overdue then is not counted. On a long path a ping is late and not lost: its answer still comes.
 */
export function lostPings(ledger: PingLedger, now: number): number {
  const wasHeldUp = now - ledger.lookedMs > LOST_AFTER_MS;
  ledger.lookedMs = now;
  const limitMs =
    ledger.roundTripMs === null ? LOST_UNKNOWN_MS : Math.max(LOST_AFTER_MS, LOST_TRIPS * ledger.roundTripMs);
  let count = 0;
  for (const [id, sent] of ledger.out) {
    if (sent >= now - limitMs) break;
    if (id > ledger.countedId) {
      ledger.countedId = id;
      count += 1;
    }
    if (sent < now - FORGOTTEN_MS) ledger.out.delete(id);
  }
  return wasHeldUp ? 0 : count;
}
