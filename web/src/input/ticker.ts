import { createRateMeter, noteOccurrence, rateOf } from "../util/samples";
import type { Disposal } from "./disposal";
import TickWorker from "./tick_worker?worker&inline";

const STALL_MS = 300; // without a tick, which comes every 10 ms
const LATE_MS = 100;

/** Ticks every 10 ms, also in a page that is not on screen, and knows whether something holds the page up. */
export class Ticker {
  private readonly stalls = createRateMeter(6000);
  private tickMs = Infinity;

  constructor(
    disposal: Disposal,
    private readonly ontick: (now: number) => void,
  ) {
    const worker = new TickWorker();
    worker.onmessage = () => this.tick(performance.now());
    disposal.add(() => worker.terminate());
  }

  /**
   * Ticks now if the page was held up. What comes first when it goes on may be a message, and nobody knows whether what
   * was held before still is.
   */
  catchUp(now: number): void {
    if (now - this.tickMs > LATE_MS) this.tick(now);
  }

  /** Whether something keeps the page from its work, again and again. */
  isHeldUp(now: number): boolean {
    return rateOf(this.stalls, now) >= 0.5;
  }

  private tick(now: number): void {
    if (now - this.tickMs > STALL_MS) noteOccurrence(this.stalls, now);
    this.tickMs = now;
    this.ontick(now);
  }
}
