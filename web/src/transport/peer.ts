import { iceCandidates, iceFragment, restartedAnswer } from "./signalling/ice_fragment";
import { hasRelay, type IceServer } from "./signalling/ice_servers";
import type { ConnectionErrorKind } from "./connection_error";
import type { ChannelName } from "./webrtc/data_channels";
import { ConsoleError, type ConsoleApi } from "./signalling/console_api";
import type { SfuTicket } from "../sfu/janus_messages";
import type { StreamInfo } from "../protocol/wire";
import type { SfuFailover } from "../sfu/sfu_failover";
import {
  USUAL_CAMERAS,
  USUAL_MICROPHONES,
  PendingConnection,
  type PendingConnectionOptions,
} from "./webrtc/pending_connection";
import { answerOf, type Preconnection } from "./webrtc/preconnection";
import type { ObserverWebSocket } from "./observer_websocket";
import type { MediaSection } from "./webrtc/media_section";
import type { StampReader } from "./encoded_transform/stamp_reader";
import type { WhepAnswer } from "./signalling/whep";

export type { ChannelName } from "./webrtc/data_channels";

/** What the page's link asks of connections. */
export interface PeerOptions extends PendingConnectionOptions {
  readonly watches: boolean; // the link is an observer's: the console may send it to a relay
  readonly thumbnail?: boolean; // one camera, small, without sound, nobody to be listed
}

/** How a connection ended. */
export class PeerEnd extends Error {
  constructor(
    readonly why: ConnectionErrorKind,
    readonly detail: string,
  ) {
    super(detail);
  }
}

export interface PeerEvents {
  message(channel: ChannelName, data: unknown, at: number): void; // `at`: when it came, by performance.now()
  troubled(): void; // WebRTC misses the other side
  ended(end: PeerEnd): void; // once, unless closed from here
  streams(streams: readonly StreamInfo[]): void; // media come from a relay, or from another one
}

const SIGNALLING_LIMIT_MS = 20_000; // for all requests until the answer
const REQUEST_LIMIT_MS = 10_000;
const PATH_LIMIT_MS = 10_000; // from the answer to the connection; and so many times what the answer took
const PATH_TRIPS = 10; // round trips of ICE and DTLS, some of them lost
const MOST_PATH_MS = 30_000; // the console gives up later

/**
 * One connection to the console: WebRTC, or for an observer behind a relay a WebSocket where one passes. It ends once;
 * connecting again makes a new one.
 */
export class Peer {
  isConnected = false; // once it was
  id = ""; // what the console calls it; "" before it has said so
  private relay: SfuFailover | null = null; // null: media come from the console
  private line: ObserverWebSocket | null = null; // instead of the WebRTC connection, which is closed then
  private readonly pending: PendingConnection;
  private readonly abort = new AbortController();
  private location = "";
  private servers: readonly IceServer[] = [];
  private tag = ""; // of the ICE session
  private timer: ReturnType<typeof setTimeout> | undefined;
  private isOver = false;
  private pathLimitMs = PATH_LIMIT_MS;

  /** `first`: what the page's first script has begun; null: nothing. */
  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly options: PeerOptions,
    private readonly events: PeerEvents,
    private readonly first: Preconnection | null = null,
  ) {
    this.pending = first?.pending ?? new PendingConnection(reader, options);
  }

  /** Returns when the answer is set; the channels open shortly after. Raises ConsoleError. */
  async connect(): Promise<void> {
    this.listen();
    const signal = AbortSignal.any([this.abort.signal, AbortSignal.timeout(SIGNALLING_LIMIT_MS)]);
    // Without an answer about relays there is still the console.
    const ticket = this.options.watches ? await this.ticket(signal).catch(() => null) : null;
    if (this.options.thumbnail === true) await this.connectSmall(signal);
    else if (ticket === null) await this.connectForMedia(signal);
    else await this.connectBeside(ticket, signal);
    if (this.line !== null) return;
    this.connection.onicegatheringstatechange = () => this.sendCandidates();
    this.sendCandidates();
    this.endAfter(this.pathLimitMs);
  }

  /** null: this observer watches with the console itself. */
  private async ticket(signal: AbortSignal): Promise<SfuTicket | null> {
    const asked = this.api.relay("", "", signal);
    const [{ parseRelayAnswer }, answer] = await Promise.all([import("./observer_parts"), asked]);
    return parseRelayAnswer(answer);
  }

  private get connection(): RTCPeerConnection {
    return this.pending.connection;
  }

  /** What the page's first script has begun may have got somewhere by now. */
  private listen(): void {
    const { connection, channels } = this.pending;
    this.pending.listen((channel, data, at) => this.events.message(channel, data, at));
    this.pending.onunreadable = () => this.finish(new PeerEnd("lost", ""));
    for (const channel of Object.values(channels)) {
      channel.onclose = () => this.finish(consoleClosed(), true);
      if (channel.readyState === "closed") this.finish(consoleClosed(), true);
    }
    connection.onconnectionstatechange = () => this.connectionChanged();
    if (connection.connectionState !== "new") this.connectionChanged();
  }

  /** Media come from the relay, everything else by a line, or by data channels where no WebSocket passes. */
  private async connectBeside(ticket: SfuTicket, signal: AbortSignal): Promise<void> {
    await this.refresh().catch(() => undefined);
    const { SfuFailover: Watch, openObserverWebSocket } = await import("./observer_parts");
    const relay = new Watch(
      this.api,
      this.reader,
      () => this.servers,
      () => this.id,
      {
        feedback: (data) => this.events.message("control", data, performance.now()),
        opened: ({ streams }) => this.events.streams(streams),
        direct: () => this.finish(new PeerEnd("relay_lost", "")),
      },
    );
    this.relay = relay; // before the welcome, whose reader asks
    this.line = await openObserverWebSocket(this.api, ticket.relay, signal, {
      message: (data) => this.events.message("session", data, performance.now()),
      ended: (why) => this.finish(why === "closed" ? consoleClosed() : new PeerEnd("silent", ""), true),
    });
    if (this.line === null) {
      await this.exchange(`relay=${encodeURIComponent(ticket.relay)}`, signal);
    } else {
      this.isConnected = true;
      for (const channel of Object.values(this.pending.channels)) channel.onclose = null;
      this.connection.close();
      if (this.isOver) this.line.close();
    }
    void relay.watch();
  }

  /** For one picture. Nothing has to be asked first: a robot has a first camera or none. */
  private async connectSmall(signal: AbortSignal): Promise<void> {
    this.pending.addSections(1, 0);
    await this.exchange("view=thumbnail", signal);
  }

  /** Most robots have no more streams than are offered at first; a console with more says so instead of an answer. */
  private async connectForMedia(signal: AbortSignal): Promise<void> {
    try {
      if (this.first !== null) await this.takeFirst(this.first);
      else {
        this.pending.addSections(USUAL_CAMERAS, USUAL_MICROPHONES);
        if (!this.options.watches) this.pending.addVoice();
        await this.exchange("sections=all", signal);
      }
    } catch (error) {
      if (!(error instanceof ConsoleError) || error.error !== "too_few_sections") throw error;
      const media = await this.api.media(AbortSignal.any([signal, AbortSignal.timeout(REQUEST_LIMIT_MS)]));
      const more = [media.cameras - USUAL_CAMERAS, media.microphones - USUAL_MICROPHONES] as const;
      this.pending.addSections(Math.max(0, more[0]), Math.max(0, more[1]));
      await this.exchange("", signal);
    }
  }

  private async takeFirst(first: Preconnection): Promise<void> {
    this.abort.signal.addEventListener("abort", () => first.abort.abort());
    const { answer, tookMs } = await answerOf(first);
    this.answered(answer, tookMs);
  }

  /** `query`: of the URL, besides what the offer itself needs. */
  private async exchange(query: string, signal: AbortSignal): Promise<void> {
    const offer = await this.pending.offer();
    const offeredMs = performance.now();
    const queries = [query, offer.query].filter((each) => each !== "").join("&");
    const answer = await this.api.offer(offer.sdp, queries, signal);
    this.answered(answer, performance.now() - offeredMs);
    await this.pending.take(answer);
  }

  private answered(answer: WhepAnswer, tookMs: number): void {
    this.pathLimitMs = Math.min(PATH_LIMIT_MS + PATH_TRIPS * tookMs, MOST_PATH_MS);
    this.location = answer.location;
    this.tag = answer.tag;
    this.servers = answer.servers;
    if (this.isOver) throw new ConsoleError(0, "closed", "closed while connecting", null);
  }

  /** The relay that pictures come through now. */
  get relayName(): string | null {
    return this.relay?.name ?? null;
  }

  /** Whether pictures and feedback come from a relay. */
  get isRelayed(): boolean {
    return this.relay !== null;
  }

  /** Whether it is a WebSocket, on which nothing is lost. */
  get usesWebSocket(): boolean {
    return this.line !== null;
  }

  /** Looks whether the other side still hears, as after a change of networks. */
  probe(): void {
    this.line?.probe();
  }

  /** Takes the console's STUN and TURN servers, for what is gathered from now on. Raises ConsoleError. */
  async refresh(): Promise<void> {
    const signal = AbortSignal.any([this.abort.signal, AbortSignal.timeout(REQUEST_LIMIT_MS)]);
    this.servers = await this.api.iceServers(signal);
    if (!this.isOver && this.line === null) this.pending.configure(this.servers);
  }

  /**
   * Moves to another path by an ICE restart; everything else lives on. A line cannot move: it is asked whether it lives.
   * Raises ConsoleError when it is refused.
   */
  async restart(): Promise<void> {
    if (this.line !== null) {
      this.line.probe();
      return;
    }
    const offer = await this.connection.createOffer({ iceRestart: true });
    await this.connection.setLocalDescription(offer);
    const answer = await this.api.restart(this.location, iceFragment(this.localSdp(), false));
    const before = this.connection.remoteDescription?.sdp ?? "";
    const sdp = restartedAnswer(before, answer.fragment);
    if (sdp === null)
      throw new ConsoleError(200, "malformed", "the console's answer has no credentials", null);
    this.tag = answer.tag;
    await this.connection.setRemoteDescription({ type: "answer", sdp });
    this.sendCandidates();
  }

  /** Says whether it could be sent. What cannot go out now is not kept: newer follows. */
  send(channel: ChannelName, text: string): boolean {
    if (this.line !== null) return this.line.send(text);
    const target = this.pending.channels[channel];
    if (target.readyState !== "open" || target.bufferedAmount > 100_000) return false;
    try {
      target.send(text);
      return true;
    } catch {
      return false; // closed between the look and the call
    }
  }

  section(mid: string): MediaSection | undefined {
    if (this.relay !== null) return this.relay.section(mid);
    return this.pending.sections.find(({ transceiver }) => transceiver.mid === mid);
  }

  /** What sends this person's voice in the section that the console named; null when it takes none. */
  voiceSender(mid: string): RTCRtpSender | null {
    const { voice } = this.pending;
    return mid !== "" && voice?.mid === mid ? voice.sender : null;
  }

  /** Ends it from here; the session is deleted, also while the page is being left. */
  close(): void {
    this.finish(null);
  }

  private connectionChanged(): void {
    const state = this.connection.connectionState;
    clearTimeout(this.timer);
    if (state === "connected") this.isConnected = true;
    else if (state === "closed") this.finish(new PeerEnd("lost", "the connection was closed"));
    else if (this.isConnected) this.events.troubled();
    else if (state === "failed") this.finish(this.noPath());
    else this.endAfter(this.pathLimitMs);
  }

  /** Ends it unless it is connected by then. */
  private endAfter(limitMs: number): void {
    clearTimeout(this.timer);
    if (!this.isConnected) this.timer = setTimeout(() => this.finish(this.noPath()), limitMs);
  }

  private noPath(): PeerEnd {
    if (this.options.relayOnly) return new PeerEnd("no_relay", "");
    return new PeerEnd(
      "no_path",
      hasRelay(this.servers) ? "The console's TURN server gave no path either" : "",
    );
  }

  private localSdp(): string {
    return this.connection.localDescription?.sdp ?? "";
  }

  /**
   * The console learns our address from our own checks (RFC 8445 7.3.1.3), so no offer waits for candidates. Those that
   * say more than an mDNS name follow in one fragment (RFC 8840).
   */
  private sendCandidates(): void {
    if (this.isOver || this.location === "" || this.connection.iceGatheringState !== "complete") return;
    const sdp = this.localSdp();
    if (iceCandidates(sdp).length === 0) return;
    // Only a help: without them the connection is still found.
    this.api.trickle(this.location, this.tag, iceFragment(sdp, true)).catch(() => undefined);
  }

  /** `gone`: the console has ended the session already. */
  private finish(end: PeerEnd | null, gone = false): void {
    if (this.isOver) return;
    this.isOver = true;
    clearTimeout(this.timer);
    this.abort.abort();
    this.relay?.close();
    this.line?.close();
    this.pending.close();
    // The console notices a lost peer by itself; asking it to end the session only makes that quicker.
    if (!gone) this.api.end(this.location).catch(() => undefined);
    if (end !== null) this.events.ended(end);
  }
}

function consoleClosed(): PeerEnd {
  return new PeerEnd("lost", "the console closed the connection");
}
