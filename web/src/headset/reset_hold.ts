import type { Side } from "../xr/headset_input";

const HOLD_MS = 1000; // the reset is held this long

/** The reset, as the page's own button: held for a second on a stop that was looked at first. */
export class ResetHold {
  private held: { readonly side: Side; readonly sinceMs: number } | null = null;

  press(side: Side, now: number): void {
    this.held = { side, sinceMs: now };
  }

  /** Returns since when it was held, in the frame in which that is long enough; else null. */
  step(isOnReset: (side: Side) => boolean, now: number): number | null {
    const { held } = this;
    if (held === null) return null;
    if (!isOnReset(held.side)) this.held = null;
    else if (now - held.sinceMs >= HOLD_MS) {
      this.held = null;
      return held.sinceMs;
    }
    return null;
  }
}
