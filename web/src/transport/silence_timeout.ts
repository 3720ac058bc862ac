/** The console says something on the feedback channel every 0.4 s, whatever the robot does. */
const SILENCE_MS = 1300;
const FIRST_WORD_MS = 15_000; // ICE, DTLS and SCTP come before it

/** Tells a relay that hangs from a robot that is silent. */
export class SilenceTimeout {
  private timer: ReturnType<typeof setTimeout>;

  constructor(private readonly fell: () => void) {
    this.timer = setTimeout(fell, FIRST_WORD_MS);
  }

  heard(): void {
    clearTimeout(this.timer);
    this.timer = setTimeout(this.fell, SILENCE_MS);
  }

  close(): void {
    clearTimeout(this.timer);
  }
}
