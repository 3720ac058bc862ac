import { parseIceServers, type IceServer } from "./ice_servers";
import { isRecord } from "../../protocol/schema_check";
import type { StopAnswer } from "../../stop/stop_press";
import { ConsoleError, request } from "./http";
import { postOffer, type WhepAnswer } from "./whep";

export { ConsoleError } from "./http";
export type { WhepAnswer } from "./whep";

/** The answer to an ICE restart. */
export interface RestartAnswer {
  readonly fragment: string;
  readonly tag: string;
}

/** What a connection can carry. */
export interface MediaOffer {
  readonly cameras: number;
  readonly microphones: number;
  readonly voice: boolean; // whether the console takes this person's voice while they drive
}

const FRAGMENT = "application/trickle-ice-sdpfrag";
const RESTART_LIMIT_MS = 10_000;
const SCENE_MS = 25_000; // the console may have to start it first

/** The console's HTTP interface (docs/console-api.md), for the holder of one token. */
export class ConsoleApi {
  /** `base`: where this robot's routes begin, against the page's own address. */
  constructor(
    private readonly token: string,
    private readonly base = "./",
  ) {}

  /** How many media there are to ask for; none while that is not known. */
  async media(signal: AbortSignal): Promise<MediaOffer> {
    const session = await this.json("GET", "/api/session", undefined, signal);
    const streams = isRecord(session) && Array.isArray(session["streams"]) ? session["streams"] : [];
    const count = (kind: string): number =>
      streams.filter((each: unknown) => isRecord(each) && each["kind"] === kind).length;
    const you = isRecord(session) && isRecord(session["you"]) ? session["you"] : {};
    const voice = isRecord(session) && session["voice"] === true && you["role"] !== "observer";
    return { cameras: count("video"), microphones: count("audio"), voice };
  }

  /** Where the console wants this observer to watch; `lost` is what the peer watched until now. */
  async relay(peer: string, lost: string, signal: AbortSignal): Promise<unknown> {
    const query = new URLSearchParams({ peer, lost });
    return await this.json("GET", `/api/relay?${query}`, undefined, signal);
  }

  /** A ticket for the line of an observer behind that relay; see `lineAddress`. */
  async watch(relay: string, signal: AbortSignal): Promise<string> {
    const query = new URLSearchParams({ relay });
    const answer = await this.json("POST", `/api/watch?${query}`, undefined, signal);
    const ticket = isRecord(answer) ? answer["ticket"] : undefined;
    if (typeof ticket !== "string") throw new ConsoleError(200, "malformed", "no ticket", null);
    return ticket;
  }

  /** Gives back a ticket that cannot be used. */
  async declineLine(ticket: string): Promise<void> {
    await this.fetch("DELETE", `/watch/${encodeURIComponent(ticket)}`, {}, undefined, undefined);
  }

  /** The WebSocket that a ticket opens. */
  lineAddress(ticket: string): string {
    return this.address(`/watch/${encodeURIComponent(ticket)}`).replace(/^http/, "ws");
  }

  /** `query` of the URL: "stamp=trailer", "relay=0". */
  async offer(sdp: string, query: string, signal: AbortSignal): Promise<WhepAnswer> {
    return await postOffer(this.token, this.address(query === "" ? "/whep" : `/whep?${query}`), sdp, signal);
  }

  /** STUN and TURN servers with credentials that are good for a while. */
  async iceServers(signal: AbortSignal): Promise<IceServer[]> {
    return parseIceServers(await this.json("GET", "/api/ice", undefined, signal));
  }

  /** Candidates found after the offer was sent. */
  async trickle(location: string, tag: string, fragment: string): Promise<void> {
    await this.fetch("PATCH", location, { "Content-Type": FRAGMENT, "If-Match": tag }, fragment, undefined);
  }

  /** Asks for an ICE restart (RFC 9725 4.3.3). */
  async restart(location: string, fragment: string): Promise<RestartAnswer> {
    const headers = { "Content-Type": FRAGMENT, "If-Match": "*" };
    const limit = AbortSignal.timeout(RESTART_LIMIT_MS);
    const response = await this.fetch("PATCH", location, headers, fragment, limit);
    return { fragment: await response.text(), tag: response.headers.get("ETag") ?? "" };
  }

  /** Ends a WHEP session; also while the page is being left. */
  async end(location: string): Promise<void> {
    if (location !== "") await this.fetch("DELETE", location, {}, undefined, undefined);
  }

  /** `press`: id of the press that this is a saying of. */
  async stop(reason: string, press: string): Promise<unknown> {
    return await this.json("POST", "/api/stop", { reason, press }, AbortSignal.timeout(3000));
  }

  /** Path of the 3D scene, valid for a short time. */
  async scene(): Promise<string> {
    const scene = await this.json("POST", "/api/scene", {}, AbortSignal.timeout(SCENE_MS));
    const path = isRecord(scene) ? scene["path"] : undefined;
    if (typeof path !== "string" || !path.startsWith("/"))
      throw new ConsoleError(200, "malformed", "no path", null);
    return path;
  }

  /** What is not JSON, as it is. */
  async bytes(path: string, signal: AbortSignal): Promise<ArrayBuffer> {
    const response = await this.fetch("GET", path, {}, undefined, signal);
    try {
      return await response.arrayBuffer();
    } catch (error) {
      throw new ConsoleError(0, "console_unreachable", error instanceof Error ? error.message : "", null);
    }
  }

  /** One request that is answered in JSON. */
  async json(method: string, path: string, body: object | undefined, signal: AbortSignal): Promise<unknown> {
    const headers: Record<string, string> = body === undefined ? {} : { "Content-Type": "application/json" };
    const text = body === undefined ? undefined : JSON.stringify(body);
    const response = await this.fetch(method, path, headers, text, signal);
    const answer: unknown = await response.json().catch(() => null);
    return answer;
  }

  /** Of a path that begins with "/", below the base; a whole address stays as it is. */
  private address(path: string): string {
    if (!path.startsWith("/")) return path;
    return new URL(path.slice(1), new URL(this.base, document.baseURI)).href;
  }

  private async fetch(
    method: string,
    path: string,
    headers: Record<string, string>,
    body: string | undefined,
    signal: AbortSignal | undefined,
  ): Promise<Response> {
    const init: RequestInit = { method, headers, keepalive: method === "DELETE" || path.endsWith("/stop") };
    if (body !== undefined) init.body = body;
    if (signal !== undefined) init.signal = signal;
    return await request(this.token, this.address(path), init);
  }
}

/** What an answer to `ConsoleApi.stop` says of that press; never raises. */
export async function stopAnswerOf(answer: Promise<unknown>, press: string): Promise<StopAnswer> {
  try {
    const found = await answer;
    if (!isRecord(found) || found["press"] !== press || typeof found["number"] !== "number")
      return { kind: "unknown" };
    return { kind: "taken", number: found["number"], kept: found["kept"] === true };
  } catch (error) {
    return { kind: error instanceof ConsoleError ? refusedStop(error.error) : "unknown" };
  }
}

function refusedStop(error: string): "waiting" | "doubtful" | "silenced" | "unknown" {
  if (error === "link_down" || error === "robot_unreachable") return "waiting";
  if (error === "unconfirmed") return "doubtful";
  return error === "silenced" ? "silenced" : "unknown";
}
