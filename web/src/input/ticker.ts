import { createRateMeter, noteOccurrence, rateOf } from "../util/samples";
import type { Disposal } from "./disposal";
import TickWorker from "./tick_worker?worker&inline";

const TICK_MS = 10;
const POLL_MS = 4; // browsers read pads about as often
const STALL_MS = 300; // without a tick
const LATE_MS = 100;

export interface TickerEvents {
  tick(now: number): void;
  /** Between two ticks, while the ticker hurries. */
  poll(now: number): void;
}

/** Ticks every 10 ms or so, also in a page that is not on screen, and knows whether something holds the page up. */
export class Ticker {
  private readonly stalls = createRateMeter(6000);
  private readonly worker = new TickWorker();
  private tickMs = Infinity;
  private hurries = false;

  constructor(
    disposal: Disposal,
    private readonly events: TickerEvents,
  ) {
    this.worker.onmessage = () => this.woken(performance.now());
    disposal.add(() => this.worker.terminate());
  }

  /**
   * Ticks now if the page was held up. What comes first when it goes on may be a message, and nobody knows whether what
   * was held before still is.
   */
  catchUp(now: number): void {
    if (this.isLate(now)) this.tick(now);
  }

  /** A frame of a headset's session: it ticks too, if the timer has not meanwhile. */
  frame(now: number): void {
    if (now - this.tickMs >= TICK_MS) this.tick(now);
  }

  /** Whether the page was held up and has not ticked since. */
  isLate(now: number): boolean {
    return now - this.tickMs > LATE_MS;
  }

  /** Whether something keeps the page from its work, again and again. */
  isHeldUp(now: number): boolean {
    return rateOf(this.stalls, now) >= 0.5;
  }

  /** Polls between the ticks, or no longer: that costs a page processor time. */
  hurry(hurries: boolean): void {
    if (hurries === this.hurries) return;
    this.hurries = hurries;
    this.worker.postMessage(hurries ? POLL_MS : TICK_MS);
  }

  private woken(now: number): void {
    if (this.hurries && now - this.tickMs < TICK_MS) this.events.poll(now);
    else this.tick(now);
  }

  private tick(now: number): void {
    if (now - this.tickMs > STALL_MS) noteOccurrence(this.stalls, now);
    this.tickMs = now;
    this.events.tick(now);
  }
}
