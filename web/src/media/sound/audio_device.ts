import { createDeviceClock, losesTime } from "./device_clock";

/** Blocks of sound that the browser asks for ahead: the shortest that it takes to be safe, 12 ms in Chromium. */
const SHORT: AudioContextLatencyCategory = "interactive";
/** In s. With the shorter ones a busy machine may miss so many that sound plays a tenth slower than it comes. */
const LONG = 0.025;

/** The page's one AudioContext. It is opened late: opening takes a quarter of a second on a small machine. */
export class AudioDevice {
  private context: AudioContext | null = null;
  private latencyHint: AudioContextLatencyCategory | number = SHORT;
  private readonly clock = createDeviceClock();

  /** The context, opened now unless it is. */
  open(): AudioContext {
    this.context ??= new AudioContext({ latencyHint: this.latencyHint });
    return this.context;
  }

  /**
   * Opens another context, with longer blocks, where this machine does not keep up with the short ones. Returns it;
   * null: the old one stays. Call often.
   */
  renewed(nowMs: number): AudioContext | null {
    const { context } = this;
    if (context?.state !== "running" || this.latencyHint === LONG) return null;
    if (!losesTime(this.clock, context.currentTime, nowMs / 1000)) return null;
    this.latencyHint = LONG;
    this.context = null;
    context.close().catch(() => undefined); // it is closed already then
    return this.open();
  }

  /** False as well while the browser waits for the user to touch the page. */
  isRunning(): boolean {
    return this.context?.state === "running";
  }

  /** Call from a touch or a key press: only then may a page begin to make sound. */
  resume(): void {
    // Without permission it stays silent, which the sound button shows.
    this.context?.resume().catch(() => undefined);
  }

  async close(): Promise<void> {
    await this.context?.close();
  }
}
