import { robotsNearby, type FleetRobot, type StopReply } from "../core/fleet_answer";
import { ConsoleApi } from "../rtc/console_api";

const LIMIT_MS = 3000;

/**
 * Says STOP to other consoles' robots at those consoles, where one entry leads to them: it needs nothing between the
 * consoles. Robots under other addresses are left to the console; a page may not ask there.
 */
export class DirectStop {
  private readonly asking = new Set<string>(); // one request at a time for each robot

  constructor(
    private readonly token: string,
    private readonly delivered: (reply: StopReply) => void,
  ) {}

  say(robots: readonly FleetRobot[], reason: string): void {
    for (const robot of robotsNearby(robots, document.baseURI))
      if (!this.asking.has(robot.name)) void this.sayTo(robot, reason);
  }

  /** A refusal is not told: the console's own answer says more. */
  private async sayTo({ name, url }: FleetRobot, reason: string): Promise<void> {
    this.asking.add(name);
    try {
      const api = new ConsoleApi(this.token, url);
      await api.json("POST", "/api/stop", { reason }, AbortSignal.timeout(LIMIT_MS));
      this.delivered({ name, delivered: true, detail: "" });
    } catch {
      // The console asks by its own way too, and names what failed.
    } finally {
      this.asking.delete(name);
    }
  }
}
