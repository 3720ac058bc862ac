import { ConsoleError, type ConsoleApi } from "./console_api";
import { iceCandidates, iceFragment, restartedAnswer } from "./ice_fragment";
import type { IceServer } from "./ice_servers";
import type { WhepAnswer } from "./whep";

const REQUEST_LIMIT_MS = 10_000;

/** What of the console's interface it needs. */
export type WhepApi = Pick<ConsoleApi, "end" | "media" | "offer" | "restart" | "trickle">;

/** The session of one connection at the console, from its offer to its end. */
export class WhepSession {
  servers: readonly IceServer[] = []; // STUN and TURN
  private location = "";
  private tag = ""; // of the ICE session
  private isEnded = false;

  constructor(private readonly api: WhepApi) {}

  /** How many media there are to ask for. */
  async media(signal: AbortSignal): Promise<{ readonly cameras: number; readonly microphones: number }> {
    return await this.api.media(AbortSignal.any([signal, AbortSignal.timeout(REQUEST_LIMIT_MS)]));
  }

  /** Returns the answer and how long it took, in ms. Raises ConsoleError. */
  async offer(
    sdp: string,
    query: string,
    signal: AbortSignal,
  ): Promise<{ readonly answer: WhepAnswer; readonly tookMs: number }> {
    const offeredMs = performance.now();
    const answer = await this.api.offer(sdp, query, signal);
    const tookMs = performance.now() - offeredMs;
    this.begin(answer);
    return { answer, tookMs };
  }

  /** Goes on with an answer. Raises ConsoleError when it was ended meanwhile. */
  begin(answer: WhepAnswer): void {
    this.location = answer.location;
    this.tag = answer.tag;
    this.servers = answer.servers;
    if (this.isEnded) throw new ConsoleError(0, "closed", "closed while connecting", null);
  }

  /** Asks for an ICE restart with the description that is set. Returns the new one of the console. */
  async restart(connection: RTCPeerConnection): Promise<string> {
    const fragment = iceFragment(connection.localDescription?.sdp ?? "", false);
    const answer = await this.api.restart(this.location, fragment);
    const sdp = restartedAnswer(connection.remoteDescription?.sdp ?? "", answer.fragment);
    if (sdp === null)
      throw new ConsoleError(200, "malformed", "the console's answer has no credentials", null);
    this.tag = answer.tag;
    return sdp;
  }

  /**
   * The console learns our address from our own checks (RFC 8445 7.3.1.3), so no offer waits for candidates. Those that
   * say more than an mDNS name follow in one fragment (RFC 8840).
   */
  trickle(connection: RTCPeerConnection): void {
    if (this.isEnded || this.location === "" || connection.iceGatheringState !== "complete") return;
    const sdp = connection.localDescription?.sdp ?? "";
    if (iceCandidates(sdp).length === 0) return;
    // Only a help: without them the connection is still found.
    this.api.trickle(this.location, this.tag, iceFragment(sdp, true)).catch(() => undefined);
  }

  /** `gone`: the console has ended it already. */
  end(gone: boolean): void {
    this.isEnded = true;
    // The console notices a lost peer by itself; asking it to end the session only makes that quicker.
    if (!gone) this.api.end(this.location).catch(() => undefined);
  }
}
