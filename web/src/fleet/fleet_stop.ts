import { parseStopReplies, type FleetRobot } from "../core/fleet_answer";
import {
  createStopAll,
  pressStopAll,
  putAway,
  stepStopAll,
  stopFailed,
  tookFleet,
  tookStopReplies,
} from "../core/stop_all";
import { ConsoleError, type ConsoleApi } from "../rtc/console_api";
import { troubleWords } from "../rtc/session_api";

const LIMIT_MS = 3000;

/** Says STOP for every robot on every way there is, until all of them report it. */
export class FleetStop {
  readonly stop = createStopAll();
  private reason = "";
  private presses = 0;

  /** `alsoSay`: on ways of its own, beside the one request to the console. */
  constructor(
    private readonly api: ConsoleApi,
    private readonly alsoSay: (reason: string) => void,
  ) {}

  /** Takes effect at once. */
  press(reason: string, robots: readonly FleetRobot[], now: number): void {
    this.reason = reason;
    this.presses += 1;
    pressStopAll(
      this.stop,
      robots.map((robot) => robot.name),
      now,
    );
    this.step(now);
  }

  /** Says it again while somebody has not confirmed it. */
  step(now: number): void {
    if (!stepStopAll(this.stop, now)) return;
    this.alsoSay(this.reason);
    void this.say(this.presses);
  }

  took(robots: readonly FleetRobot[], askedMs: number): void {
    tookFleet(this.stop, robots, askedMs);
  }

  putAway(): void {
    putAway(this.stop);
  }

  /** The answer to an earlier press says nothing of this one. */
  private async say(press: number): Promise<void> {
    try {
      const limit = AbortSignal.timeout(LIMIT_MS);
      const answer = await this.api.json("POST", "/api/fleet/stop", { reason: this.reason }, limit);
      const replies = parseStopReplies(answer);
      if (press !== this.presses) return;
      if (replies === null) stopFailed(this.stop, "The console’s answer cannot be read.");
      else tookStopReplies(this.stop, replies);
    } catch (error) {
      if (press === this.presses) stopFailed(this.stop, failureWords(error));
    }
  }
}

function failureWords(error: unknown): string {
  return error instanceof ConsoleError && error.status === 0
    ? "The console does not answer."
    : troubleWords(error);
}
