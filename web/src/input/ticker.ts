import { createRateMeter, noteHappening, rateOf } from "../core/samples";
import type { Disposal } from "./disposal";

const STALL_MS = 300; // without a tick, which comes every 10 ms

/** Ticks every 10 ms, also in a page that is not on screen, and knows whether something holds the page up. */
export class Ticker {
  private readonly stalls = createRateMeter(6000);
  private tickMs = Infinity;

  constructor(disposal: Disposal, ontick: (now: number) => void) {
    const worker = new Worker(new URL("./tick_worker.ts", import.meta.url), { type: "module" });
    worker.onmessage = () => {
      const now = performance.now();
      if (now - this.tickMs > STALL_MS) noteHappening(this.stalls, now);
      this.tickMs = now;
      ontick(now);
    };
    disposal.add(() => worker.terminate());
  }

  /** Whether something keeps the page from its work, again and again. */
  isHeldUp(now: number): boolean {
    return rateOf(this.stalls, now) >= 0.5;
  }
}
