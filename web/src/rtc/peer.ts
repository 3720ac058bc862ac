import { iceCandidates, iceFragment, restartedAnswer } from "../core/ice_fragment";
import { hasRelay, type IceServer } from "../core/ice_servers";
import type { LinkTrouble } from "../core/trouble";
import { ConsoleError, type ConsoleApi } from "./console_api";
import type { RelayTicket } from "../core/relay";
import type { StreamInfo } from "../wire";
import { RelayWatch } from "./relay_watch";
import { preferH264 } from "./codec_preference";
import { askForCaptureTime } from "./header_extensions";
import { openLine, type WatchLine } from "./watch_line";
import { receivedSection, type Section } from "./section";
import type { StampReader } from "./stamp_reader";

export type ChannelName = "control" | "session" | "stop";

interface OfferedSection extends Section {
  readonly transceiver: RTCRtpTransceiver;
}

/** What the page's link asks of connections. */
export interface PeerOptions {
  readonly trailer: boolean; // the event reference travels in trailers
  readonly relayOnly: boolean; // through TURN or not at all
  readonly watches: boolean; // the link is an observer's: the console may send it to a relay
  readonly thumbnail?: boolean; // one camera, small, without sound, nobody to be listed
}

/** How a connection ended. */
export class PeerEnd extends Error {
  constructor(
    readonly why: LinkTrouble,
    readonly detail: string,
  ) {
    super(detail);
  }
}

export interface PeerEvents {
  message(channel: ChannelName, data: unknown): void;
  troubled(): void; // WebRTC misses the other side
  ended(end: PeerEnd): void; // once, unless closed from here
  streams(streams: readonly StreamInfo[]): void; // media come from a relay, or from another one
}

/** Offered before the console has said how many there are; sections too many are answered inactive. */
const USUAL_CAMERAS = 2;
const USUAL_MICROPHONES = 1;
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
  readonly sections: OfferedSection[] = [];
  isConnected = false; // once it was
  id = ""; // what the console calls it; "" before it has said so
  private relay: RelayWatch | null = null; // null: media come from the console
  private line: WatchLine | null = null; // instead of the WebRTC connection, which is closed then
  private readonly connection: RTCPeerConnection;
  private readonly channels: Record<ChannelName, RTCDataChannel>;
  private readonly abort = new AbortController();
  private voice: RTCRtpTransceiver | null = null; // nothing is sent in it before somebody talks
  private location = "";
  private servers: readonly IceServer[] = [];
  private tag = ""; // of the ICE session
  private timer: ReturnType<typeof setTimeout> | undefined;
  private isOver = false;
  private pathLimitMs = PATH_LIMIT_MS;

  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly options: PeerOptions,
    private readonly events: PeerEvents,
  ) {
    this.connection = new RTCPeerConnection(this.configuration());
    this.channels = {
      control: this.openChannel("control", { ordered: false, maxRetransmits: 0 }),
      session: this.openChannel("session", {}),
      stop: this.openChannel("stop", {}),
    };
    this.connection.onconnectionstatechange = () => this.connectionChanged();
  }

  /** Returns when the answer is set; the channels open shortly after. Raises ConsoleError. */
  async connect(): Promise<void> {
    const signal = AbortSignal.any([this.abort.signal, AbortSignal.timeout(SIGNALLING_LIMIT_MS)]);
    // Without an answer about relays there is still the console.
    const ticket = this.options.watches ? await this.api.relay("", "", signal).catch(() => null) : null;
    if (this.options.thumbnail === true) await this.connectSmall(signal);
    else if (ticket === null) await this.connectForMedia(signal);
    else await this.connectBeside(ticket, signal);
    if (this.line !== null) return;
    this.connection.onicegatheringstatechange = () => this.sendCandidates();
    this.sendCandidates();
    this.endAfter(this.pathLimitMs);
  }

  /** Media come from the relay, everything else by a line, or by data channels where no WebSocket passes. */
  private async connectBeside(ticket: RelayTicket, signal: AbortSignal): Promise<void> {
    await this.refresh().catch(() => undefined);
    const relay = new RelayWatch(
      this.api,
      this.reader,
      () => this.servers,
      () => this.id,
      {
        feedback: (data) => this.events.message("control", data),
        opened: ({ streams }) => this.events.streams(streams),
        direct: () => this.finish(new PeerEnd("relay_lost", "")),
      },
    );
    this.relay = relay; // before the welcome, whose reader asks
    this.line = await openLine(this.api, ticket.relay, signal, {
      message: (data) => this.events.message("session", data),
      ended: (why) => this.finish(why === "closed" ? consoleClosed() : new PeerEnd("silent", ""), true),
    });
    if (this.line === null) {
      await this.connection.setLocalDescription();
      await this.exchange(`relay=${encodeURIComponent(ticket.relay)}`, signal);
    } else {
      this.isConnected = true;
      for (const channel of Object.values(this.channels)) channel.onclose = null;
      this.connection.close();
      if (this.isOver) this.line.close();
    }
    void relay.watch();
  }

  /** For one picture. Nothing has to be asked first: a robot has a first camera or none. */
  private async connectSmall(signal: AbortSignal): Promise<void> {
    await this.refresh().catch(() => undefined);
    const trailer = this.addSections(1, 0);
    await this.connection.setLocalDescription();
    await this.exchange(trailer ? "view=thumbnail&stamp=trailer" : "view=thumbnail", signal);
  }

  private async connectForMedia(signal: AbortSignal): Promise<void> {
    const media = this.api.media(AbortSignal.any([signal, AbortSignal.timeout(REQUEST_LIMIT_MS)]));
    // Without these servers there may still be a direct path.
    const servers = this.refresh().catch(() => undefined);
    let trailer = this.addSections(USUAL_CAMERAS, USUAL_MICROPHONES);
    // The first offer makes the browser look for its codecs, which takes as long as the console's answer.
    const [offer, usual] = await Promise.all([media, this.connection.createOffer(), servers]);
    const cameras = Math.max(0, offer.cameras - USUAL_CAMERAS);
    const microphones = Math.max(0, offer.microphones - USUAL_MICROPHONES);
    const more = cameras + microphones > 0 || offer.voice;
    if (offer.voice) this.voice = this.connection.addTransceiver("audio", { direction: "sendonly" });
    if (cameras + microphones > 0) trailer = this.addSections(cameras, microphones) || trailer;
    await this.connection.setLocalDescription(more ? await this.connection.createOffer() : usual);
    await this.exchange(trailer ? "stamp=trailer" : "", signal);
  }

  private async exchange(query: string, signal: AbortSignal): Promise<void> {
    const offeredMs = performance.now();
    const answer = await this.api.offer(this.localSdp(), query, signal);
    const tookMs = performance.now() - offeredMs;
    this.pathLimitMs = Math.min(PATH_LIMIT_MS + PATH_TRIPS * tookMs, MOST_PATH_MS);
    this.location = answer.location;
    this.tag = answer.tag;
    if (this.isOver) throw new ConsoleError(0, "closed", "closed while connecting", null);
    await this.connection.setRemoteDescription({ type: "answer", sdp: answer.sdp });
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
  get isOnLine(): boolean {
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
    if (!this.isOver && this.line === null) this.connection.setConfiguration(this.configuration());
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
    const target = this.channels[channel];
    if (target.readyState !== "open" || target.bufferedAmount > 100_000) return false;
    try {
      target.send(text);
      return true;
    } catch {
      return false; // closed between the look and the call
    }
  }

  section(mid: string): Section | undefined {
    if (this.relay !== null) return this.relay.section(mid);
    return this.sections.find(({ transceiver }) => transceiver.mid === mid);
  }

  /** What sends this person's voice in the section that the console named; null when it takes none. */
  voiceSender(mid: string): RTCRtpSender | null {
    return mid !== "" && this.voice?.mid === mid ? this.voice.sender : null;
  }

  /** Ends it from here; the session is deleted, also while the page is being left. */
  close(): void {
    this.finish(null);
  }

  private addSections(cameras: number, microphones: number): boolean {
    const kinds = [...Array<"video">(cameras).fill("video"), ...Array<"audio">(microphones).fill("audio")];
    const transceivers = kinds.map((kind) => this.connection.addTransceiver(kind, { direction: "recvonly" }));
    for (const transceiver of transceivers.slice(0, cameras)) preferH264(transceiver);
    const offered = transceivers.map((transceiver, index) =>
      askForCaptureTime(transceiver, kinds[index] ?? "video"),
    );
    const trailer = this.options.trailer || offered.includes(false);
    for (const [index, transceiver] of transceivers.entries()) {
      const kind = kinds[index] ?? "video";
      const stamps = this.reader?.attach(transceiver.receiver, kind, trailer) ?? null;
      this.sections.push({ ...receivedSection(kind, transceiver.receiver, stamps), transceiver });
    }
    return trailer;
  }

  private openChannel(name: ChannelName, options: RTCDataChannelInit): RTCDataChannel {
    const channel = this.connection.createDataChannel(name, options);
    channel.onmessage = (event: MessageEvent<unknown>) => this.events.message(name, event.data);
    channel.onclose = () => this.finish(consoleClosed(), true);
    return channel;
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
      hasRelay(this.servers) ? "The console's TURN server did not help either" : "",
    );
  }

  private configuration(): RTCConfiguration {
    const iceServers = this.servers.map((server) => ({ ...server, urls: [...server.urls] }));
    const iceTransportPolicy = this.options.relayOnly ? "relay" : "all";
    return { bundlePolicy: "max-bundle", iceServers, iceTransportPolicy };
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
    for (const { stamps } of this.sections) if (stamps !== null) this.reader?.detach(stamps);
    this.connection.close();
    // The console notices a lost peer by itself; asking it to end the session only makes that quicker.
    if (!gone) this.api.end(this.location).catch(() => undefined);
    if (end !== null) this.events.ended(end);
  }
}

function consoleClosed(): PeerEnd {
  return new PeerEnd("lost", "the console closed the connection");
}
