import { parsePairingCode, parseRobotLink, type PairingCode, type RobotLink } from "../../session/robot_link";
import { ConsoleError, type ConsoleApi } from "./console_api";

const LIMIT_MS = 8000;

/** Pairing of a robot that dials in, over HTTP. All of it raises ConsoleError. */
export class RobotLinkApi {
  constructor(private readonly api: ConsoleApi) {}

  async state(): Promise<RobotLink> {
    return linkOf(await this.ask("GET", "/api/dial-in"));
  }

  /** A new code, in place of any other. */
  async openCode(): Promise<PairingCode> {
    const found = parsePairingCode(await this.ask("POST", "/api/dial-in/code"));
    if (found === null) throw new ConsoleError(200, "malformed", "the console's answer has no code", null);
    return found;
  }

  async closeCode(): Promise<RobotLink> {
    return linkOf(await this.ask("DELETE", "/api/dial-in/code"));
  }

  /** Ends the robot's links at once; it does not come in again. */
  async forget(): Promise<RobotLink> {
    return linkOf(await this.ask("DELETE", "/api/dial-in/robot"));
  }

  private ask(method: string, path: string): Promise<unknown> {
    return this.api.json(method, path, undefined, AbortSignal.timeout(LIMIT_MS));
  }
}

function linkOf(answer: unknown): RobotLink {
  const found = parseRobotLink(answer);
  if (found === null)
    throw new ConsoleError(200, "malformed", "the console's answer is not understood", null);
  return found;
}
