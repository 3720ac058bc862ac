/** The display that the person looks at instead of the window, while an immersive session lasts. */
export interface ImmersiveDisplay {
  readonly visible: boolean; // the session is, and not blurred
}

/**
 * Where the page's frames come from, and whether a person sees it: the window, or an immersive session while there is
 * one. Headsets stop the window's own frames meanwhile, or call its document hidden.
 */
export class Display {
  private immersive: ImmersiveDisplay | null = null;
  private readonly waiting = new Map<number, FrameRequestCallback>();
  private last = 0;
  private asked = 0; // of the window; 0: nothing is

  get isImmersive(): boolean {
    return this.immersive !== null;
  }

  get visible(): boolean {
    return this.immersive?.visible ?? !document.hidden;
  }

  /** As requestAnimationFrame: the next frame of whatever shows the page. */
  request(callback: FrameRequestCallback): number {
    this.waiting.set(++this.last, callback);
    this.ask();
    return this.last;
  }

  cancel(handle: number): void {
    this.waiting.delete(handle);
  }

  /** From now on frames are those that `frame` is called for. */
  enter(immersive: ImmersiveDisplay): void {
    this.immersive = immersive;
    cancelAnimationFrame(this.asked);
    this.asked = 0;
  }

  /** The window's own again. */
  leave(): void {
    this.immersive = null;
    this.ask();
  }

  /** A frame begins at `now`, performance.now(). */
  frame(now: number): void {
    const due = [...this.waiting.values()];
    this.waiting.clear();
    for (const callback of due)
      try {
        callback(now);
      } catch (error) {
        reportError(error); // as the window does: the others are still called
      }
  }

  private ask(): void {
    if (this.immersive !== null || this.asked !== 0 || this.waiting.size === 0) return;
    this.asked = requestAnimationFrame((now) => {
      this.asked = 0;
      this.frame(now);
    });
  }
}
