/** Calls once after some milliseconds. A new time takes the place of the one before. */
export class SendTimer {
  private handle: ReturnType<typeof setTimeout> | null = null;

  constructor(private readonly due: () => void) {}

  /** `ms`: null for never. */
  set(ms: number | null): void {
    if (this.handle !== null) clearTimeout(this.handle);
    // A browser cuts fractions off, and a timer that is early finds the gate shut.
    this.handle = ms === null ? null : setTimeout(() => this.ring(), Math.ceil(ms));
  }

  private ring(): void {
    this.handle = null;
    this.due();
  }
}
