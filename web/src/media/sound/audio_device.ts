/**
 * Blocks of sound that the browser asks for ahead, in s. With the 12 ms of "interactive" a busy machine misses so many
 * that sound plays a tenth slower than it comes.
 */
const BLOCK_S = 0.025;

/** The page's one AudioContext. It is opened late: opening takes a quarter of a second on a small machine. */
export class AudioDevice {
  private context: AudioContext | null = null;

  /** The context, opened now unless it is. */
  open(): AudioContext {
    this.context ??= new AudioContext({ latencyHint: BLOCK_S });
    return this.context;
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
