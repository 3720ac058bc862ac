import { robotsNearby, type FleetRobot, type StopReply } from "./fleet_status";
import { ConsoleApi, stopAnswerOf } from "../transport/signalling/console_api";

/**
 * Says STOP to other consoles' robots at those consoles, where one entry leads to them: it needs nothing between the
 * consoles. Robots under other addresses are left to the console; a page may not ask there.
 */
export class DirectStop {
  private readonly asking = new Set<string>(); // one request at a time for each robot

  constructor(
    private readonly token: string,
    private readonly confirmed: (press: string, reply: StopReply) => void,
  ) {}

  say(robots: readonly FleetRobot[], reason: string, press: string): void {
    for (const robot of robotsNearby(robots, document.baseURI))
      if (!this.asking.has(robot.name)) void this.sayTo(robot, reason, press);
  }

  /** A refusal is not told: the console asks by its own way too, and its answer says more. */
  private async sayTo({ name, url }: FleetRobot, reason: string, press: string): Promise<void> {
    this.asking.add(name);
    try {
      const api = new ConsoleApi(this.token, url);
      const answer = await stopAnswerOf(api.stop(reason, press), press);
      if (answer.kind === "taken")
        this.confirmed(press, { name, delivered: true, kept: answer.kept, detail: "" });
    } finally {
      this.asking.delete(name);
    }
  }
}
