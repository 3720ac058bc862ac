import { createPingLedger, lostPings, pingAnswered, sendPing } from "./ping_ledger";
import type { ClientMessage, Report } from "../protocol/wire";

const BEAT_MS = 500; // reports and pings
const OBSERVER_BEAT_MS = 1000; // of somebody who cannot drive; there may be hundreds
const SLOW_BEAT_MS = 5000; // of an observer whose media come from a relay: nobody waits for its reports
const RELIABLE_BEAT_MS = 15_000; // of one whose transport loses nothing
const EARLY_PINGS = 5; // to know the path before the first command
const EARLY_PING_MS = 50; // between them

export interface HeartbeatEvents {
  tell(message: ClientMessage): boolean;
  report(): Report;
  lost(now: number): void; // pings were not answered in time
}

/** What one connection says on its own: reports and pings, once or twice a second, and a few pings at its beginning. */
export class Heartbeat {
  isSlow = false;
  isReliable = false;
  observes = false;
  private readonly pings = createPingLedger();
  private early = 0; // pings still to send
  private earlyMs = 0;
  private beatMs = 0;

  constructor(private readonly events: HeartbeatEvents) {}

  begin(): void {
    this.early = EARLY_PINGS;
  }

  end(): void {
    this.early = 0;
    this.pings.out.clear();
  }

  step(now: number): void {
    if (now >= this.beatMs) {
      this.beatMs = now + this.interval();
      this.ping(now, this.events.report());
    } else if (this.early > 0 && now >= this.earlyMs) {
      this.earlyMs = now + EARLY_PING_MS;
      this.early -= 1;
      this.ping(now);
    }
  }

  /** The round trip, null when the ping is not known any more. */
  answered(id: number, now: number): number | null {
    return pingAnswered(this.pings, id, now);
  }

  private interval(): number {
    if (this.isSlow) return this.isReliable ? RELIABLE_BEAT_MS : SLOW_BEAT_MS;
    return this.observes ? OBSERVER_BEAT_MS : BEAT_MS;
  }

  /** With a report, in the same message; or alone. */
  private ping(now: number, report?: Report): void {
    if (lostPings(this.pings, now) > 0) this.events.lost(now);
    const id = sendPing(this.pings, now);
    const message: ClientMessage = report === undefined ? { type: "ping", id } : { ...report, ping: id };
    if (!this.events.tell(message)) this.pings.out.delete(id); // did not leave: is not lost
  }
}
