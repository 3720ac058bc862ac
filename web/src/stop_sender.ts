import type { ConsoleApi } from "./rtc/console_api";
import type { Connection } from "./rtc/connection";

const REPEAT_MS = 250;
const GIVE_UP_MS = 10_000;

/** Says STOP on every way there is, again and again until the robot reports that it is stopped. */
export class StopSender {
  private sinceMs: number | null = null; // null: nothing pending
  private nextMs = 0;
  private nextHttpMs = 0;
  private reason = "";
  failed = false; // given up unconfirmed

  constructor(
    private readonly api: ConsoleApi,
    private readonly connection: Connection,
  ) {}

  get isPending(): boolean {
    return this.sinceMs !== null;
  }

  stop(reason: string, now: number): void {
    this.reason = reason;
    this.sinceMs = now;
    this.nextMs = this.nextHttpMs = now;
    this.failed = false;
    this.step(false, now);
  }

  /** Repeats while the robot does not report the stop. */
  step(stopped: boolean, now: number): void {
    if (this.sinceMs === null) return;
    if (stopped && now > this.sinceMs) {
      this.sinceMs = null;
      this.failed = false;
      return;
    }
    this.failed = now - this.sinceMs > GIVE_UP_MS;
    if (this.failed) this.sinceMs = null;
    else if (now >= this.nextMs) this.say(now);
  }

  private say(now: number): void {
    this.nextMs = now + REPEAT_MS;
    const text = JSON.stringify({ type: "stop", by: "", reason: this.reason });
    this.connection.send("stop", text);
    this.connection.send("control", text);
    if (now < this.nextHttpMs) return;
    this.nextHttpMs = now + 4 * REPEAT_MS;
    // A failure shows as a stop that is not confirmed; the next repeat comes anyway.
    this.api.stop(this.reason).catch(() => undefined);
  }
}
