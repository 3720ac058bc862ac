import { parseStopReplies, type FleetRobot } from "./fleet_status";
import {
  createStopAll,
  pressStopAll,
  putAway,
  stepStopAll,
  stopFailed,
  tookFleet,
  tookStopReplies,
} from "./stop_all";
import { pressId } from "../stop/stop_press";
import { ConsoleError, type ConsoleApi } from "../transport/signalling/console_api";
import { requestErrorLabel } from "../transport/signalling/session_api";

const LIMIT_MS = 3000;

/** Says STOP for every robot on every way there is, until all of them have confirmed it. */
export class StopAllSender {
  readonly stop = createStopAll();
  private reason = "";

  /** `alsoSay`: on ways of its own, beside the one request to the console. */
  constructor(
    private readonly api: ConsoleApi,
    private readonly alsoSay: (reason: string, press: string) => void,
  ) {}

  /** Takes effect at once. */
  press(reason: string, robots: readonly FleetRobot[], now: number): void {
    this.reason = reason;
    const press = pressId(crypto.getRandomValues(new Uint8Array(16)));
    pressStopAll(
      this.stop,
      press,
      robots.map((robot) => robot.name),
      now,
    );
    this.step(now);
  }

  /** Says it again while somebody has not confirmed it. */
  step(now: number): void {
    if (!stepStopAll(this.stop, now)) return;
    const { press } = this.stop;
    this.alsoSay(this.reason, press);
    void this.say(this.reason, press);
  }

  took(robots: readonly FleetRobot[]): void {
    tookFleet(this.stop, robots);
  }

  putAway(): void {
    putAway(this.stop);
  }

  private async say(reason: string, press: string): Promise<void> {
    const limit = AbortSignal.timeout(LIMIT_MS);
    try {
      const answer = await this.api.json("POST", "/api/fleet/stop", { reason, press }, limit);
      const replies = parseStopReplies(answer);
      if (replies === null) stopFailed(this.stop, press, "The console’s answer cannot be read.");
      else tookStopReplies(this.stop, press, replies);
    } catch (error) {
      stopFailed(this.stop, press, failureWords(error));
    }
  }
}

function failureWords(error: unknown): string {
  return error instanceof ConsoleError && error.status === 0
    ? "The console does not answer."
    : requestErrorLabel(error);
}
