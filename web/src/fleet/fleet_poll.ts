import { parseFleet, type FleetStatus } from "./fleet_status";
import type { PollError } from "./poll_state";
import { connectionErrorOf } from "../transport/connection_error";
import { ConsoleError, type ConsoleApi } from "../transport/signalling/console_api";

const POLL_MS = 1000;
const HIDDEN_MS = 5000; // nobody looks
const REFUSED_MS = 5000; // a link that was refused is not refused less a moment later
const LIMIT_MS = 4000;

export interface FleetPollEvents {
  answer(answer: FleetStatus, askedMs: number): void;
  trouble(trouble: PollError): void;
}

/** Asks how the robots are, once a second; one question at a time. */
export class FleetPoll {
  private readonly abort = new AbortController();
  private wake: () => void = () => undefined;

  constructor(
    private readonly api: ConsoleApi,
    private readonly events: FleetPollEvents,
  ) {}

  /** Until it is closed, or the link is good for nothing any more. */
  async run(): Promise<void> {
    while (!this.isClosed()) {
      const askedMs = performance.now();
      const trouble = await this.ask(askedMs);
      if (this.isClosed()) return;
      if (trouble !== null) this.events.trouble(trouble);
      if (trouble !== null && "ended" in trouble) return;
      await this.sleep(askedMs + pauseOf(trouble) - performance.now());
    }
  }

  /** Asks now instead of at the end of the pause. */
  askNow(): void {
    this.wake();
  }

  close(): void {
    this.abort.abort();
    this.wake();
  }

  private isClosed(): boolean {
    return this.abort.signal.aborted;
  }

  private async ask(askedMs: number): Promise<PollError | null> {
    try {
      const signal = AbortSignal.any([this.abort.signal, AbortSignal.timeout(LIMIT_MS)]);
      const answer = parseFleet(await this.api.json("GET", "/api/fleet", undefined, signal));
      if (answer === null) return { why: "refused" };
      if (!this.isClosed()) this.events.answer(answer, askedMs);
      return null;
    } catch (error) {
      return describe(error);
    }
  }

  private async sleep(waitMs: number): Promise<void> {
    await new Promise<void>((resolve) => {
      const timer = setTimeout(resolve, waitMs);
      this.wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
  }
}

function describe(error: unknown): PollError {
  if (!(error instanceof ConsoleError)) return { why: "refused" };
  if (error.error === "link_revoked" || error.error === "link_expired") return { ended: error.error };
  return { why: connectionErrorOf(error.status, error.error) };
}

function pauseOf(trouble: PollError | null): number {
  if (trouble !== null && "why" in trouble && trouble.why === "token_refused") return REFUSED_MS;
  return document.hidden ? HIDDEN_MS : POLL_MS;
}
