import { iceCandidates, iceFragment, restartedAnswer } from "../signalling/ice_fragment";
import { hasTurn, type IceServer } from "../signalling/ice_servers";
import { ConsoleError, type ConsoleApi } from "../signalling/console_api";
import { TransportEnd, type Transport, type TransportEvents } from "../transport";
import type { ChannelName } from "./data_channels";
import type { MediaSection } from "./media_section";
import {
  USUAL_CAMERAS,
  USUAL_MICROPHONES,
  type PendingConnection,
  type PendingConnectionOptions,
} from "./pending_connection";
import { answerOf, type Preconnection } from "./preconnection";
import type { WhepAnswer } from "../signalling/whep";

const REQUEST_LIMIT_MS = 10_000;
const PATH_LIMIT_MS = 10_000; // from the answer to the connection; and so many times what the answer took
const PATH_TRIPS = 10; // round trips of ICE and DTLS, some of them lost
const MOST_PATH_MS = 30_000; // the console gives up later
const MAX_WAITING = 100_000; // bytes

/** What of the console's interface it needs. */
export type WebRtcApi = Pick<ConsoleApi, "end" | "media" | "offer" | "restart" | "trickle">;

/** Messages, pictures and sound by WebRTC. Order: `listen`; one of the `connect…` methods; `close`. */
export class WebRtcTransport implements Transport {
  isConnected = false;
  readonly isReliable = false;
  servers: readonly IceServer[] = []; // STUN and TURN
  private location = "";
  private tag = ""; // of the ICE session
  private timer: ReturnType<typeof setTimeout> | undefined;
  private isOver = false;
  private pathLimitMs = PATH_LIMIT_MS;

  constructor(
    private readonly api: WebRtcApi,
    private readonly pending: PendingConnection,
    private readonly options: PendingConnectionOptions,
    private readonly events: TransportEvents,
  ) {}

  /** From now on. What the page's first script has begun may have got somewhere by now. */
  listen(): void {
    const { connection, channels } = this.pending;
    this.pending.listen((channel, data, at) => this.events.message(channel, data, at));
    this.pending.onunreadable = () => this.end(new TransportEnd("lost", ""));
    for (const channel of Object.values(channels)) {
      channel.onclose = () => this.consoleClosed();
      if (channel.readyState === "closed") this.consoleClosed();
    }
    connection.onconnectionstatechange = () => this.connectionChanged();
    if (connection.connectionState !== "new") this.connectionChanged();
  }

  /** Goes on with what the page's first script has begun. As `connectForMedia`. */
  async connectFirst(first: Preconnection, signal: AbortSignal): Promise<void> {
    signal.addEventListener("abort", () => first.abort.abort());
    await this.withMoreSections(signal, async () => {
      const { answer, tookMs } = await answerOf(first);
      this.answered(answer, tookMs);
      this.awaitPath();
    });
  }

  /** For all pictures and sound; `voice`: for this person's too. Returns when the answer is set. Raises ConsoleError. */
  async connectForMedia(voice: boolean, signal: AbortSignal): Promise<void> {
    this.pending.addSections(USUAL_CAMERAS, USUAL_MICROPHONES);
    if (voice) this.pending.addVoice();
    await this.withMoreSections(signal, () => this.connect("sections=all", signal));
  }

  /** For one small picture. Nothing has to be asked first: a robot has a first camera or none. */
  async connectForThumbnail(signal: AbortSignal): Promise<void> {
    this.pending.addSections(1, 0);
    await this.connect("view=thumbnail", signal);
  }

  /** For messages alone, beside the relay that media come from. */
  async connectBeside(relay: string, signal: AbortSignal): Promise<void> {
    await this.connect(`relay=${encodeURIComponent(relay)}`, signal);
  }

  /** Takes STUN and TURN servers, for what is gathered from now on. */
  configure(servers: readonly IceServer[]): void {
    this.servers = servers;
    if (!this.isOver) this.pending.configure(servers);
  }

  /** WebRTC's own checks of consent do that. */
  probe(): void {
    return;
  }

  /** An ICE restart. */
  async restart(): Promise<void> {
    const { connection } = this.pending;
    const offer = await connection.createOffer({ iceRestart: true });
    await connection.setLocalDescription(offer);
    const answer = await this.api.restart(this.location, iceFragment(this.localSdp(), false));
    const before = connection.remoteDescription?.sdp ?? "";
    const sdp = restartedAnswer(before, answer.fragment);
    if (sdp === null)
      throw new ConsoleError(200, "malformed", "the console's answer has no credentials", null);
    this.tag = answer.tag;
    await connection.setRemoteDescription({ type: "answer", sdp });
    this.sendCandidates();
  }

  send(channel: ChannelName, text: string): boolean {
    const target = this.pending.channels[channel];
    if (target.readyState !== "open" || target.bufferedAmount > MAX_WAITING) return false;
    try {
      target.send(text);
      return true;
    } catch {
      return false; // closed between the look and the call
    }
  }

  section(mid: string): MediaSection | undefined {
    return this.pending.sections.find(({ transceiver }) => transceiver.mid === mid);
  }

  /** What sends this person's voice in the section that the console named; null when it takes none. */
  voiceSender(mid: string): RTCRtpSender | null {
    const { voice } = this.pending;
    return mid !== "" && voice?.mid === mid ? voice.sender : null;
  }

  /** The session is deleted, also while the page is being left. */
  close(): void {
    this.finish(false);
  }

  /** Most robots have no more streams than are offered at first; a console with more says so instead of an answer. */
  private async withMoreSections(signal: AbortSignal, connect: () => Promise<void>): Promise<void> {
    try {
      await connect();
    } catch (error) {
      if (!(error instanceof ConsoleError) || error.error !== "too_few_sections") throw error;
      const media = await this.api.media(AbortSignal.any([signal, AbortSignal.timeout(REQUEST_LIMIT_MS)]));
      const more = [media.cameras - USUAL_CAMERAS, media.microphones - USUAL_MICROPHONES] as const;
      this.pending.addSections(Math.max(0, more[0]), Math.max(0, more[1]));
      await this.connect("", signal);
    }
  }

  /** `query`: of the URL, besides what the offer itself needs. */
  private async connect(query: string, signal: AbortSignal): Promise<void> {
    const offer = await this.pending.offer();
    const offeredMs = performance.now();
    const queries = [query, offer.query].filter((each) => each !== "").join("&");
    const answer = await this.api.offer(offer.sdp, queries, signal);
    this.answered(answer, performance.now() - offeredMs);
    await this.pending.take(answer);
    this.awaitPath();
  }

  private answered(answer: WhepAnswer, tookMs: number): void {
    this.pathLimitMs = Math.min(PATH_LIMIT_MS + PATH_TRIPS * tookMs, MOST_PATH_MS);
    this.location = answer.location;
    this.tag = answer.tag;
    this.servers = answer.servers;
    if (this.isOver) throw new ConsoleError(0, "closed", "closed while connecting", null);
  }

  private awaitPath(): void {
    this.pending.connection.onicegatheringstatechange = () => this.sendCandidates();
    this.sendCandidates();
    this.endAfter(this.pathLimitMs);
  }

  private connectionChanged(): void {
    const state = this.pending.connection.connectionState;
    clearTimeout(this.timer);
    if (state === "connected") this.isConnected = true;
    else if (state === "closed") this.end(new TransportEnd("lost", "the connection was closed"));
    else if (this.isConnected) this.events.troubled();
    else if (state === "failed") this.end(this.noPath());
    else this.endAfter(this.pathLimitMs);
  }

  /** Ends it unless it is connected by then. */
  private endAfter(limitMs: number): void {
    clearTimeout(this.timer);
    if (!this.isConnected) this.timer = setTimeout(() => this.end(this.noPath()), limitMs);
  }

  private noPath(): TransportEnd {
    if (this.options.turnOnly) return new TransportEnd("no_turn_path", "");
    return new TransportEnd(
      "no_path",
      hasTurn(this.servers) ? "The console's TURN server gave no path either" : "",
    );
  }

  private localSdp(): string {
    return this.pending.connection.localDescription?.sdp ?? "";
  }

  /**
   * The console learns our address from our own checks (RFC 8445 7.3.1.3), so no offer waits for candidates. Those that
   * say more than an mDNS name follow in one fragment (RFC 8840).
   */
  private sendCandidates(): void {
    if (this.isOver || this.location === "") return;
    if (this.pending.connection.iceGatheringState !== "complete") return;
    const sdp = this.localSdp();
    if (iceCandidates(sdp).length === 0) return;
    // Only a help: without them the connection is still found.
    this.api.trickle(this.location, this.tag, iceFragment(sdp, true)).catch(() => undefined);
  }

  private consoleClosed(): void {
    this.end(new TransportEnd("lost", "the console closed the connection"), true);
  }

  /** `gone`: the console has ended the session already. */
  private end(end: TransportEnd, gone = false): void {
    if (this.isOver) return;
    this.finish(gone);
    this.events.ended(end);
  }

  private finish(gone: boolean): void {
    if (this.isOver) return;
    this.isOver = true;
    clearTimeout(this.timer);
    this.pending.close();
    // The console notices a lost peer by itself; asking it to end the session only makes that quicker.
    if (!gone) this.api.end(this.location).catch(() => undefined);
  }
}
