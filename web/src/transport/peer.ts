import type { ChannelName } from "./webrtc/data_channels";
import type { ConsoleApi } from "./signalling/console_api";
import type { SfuTicket } from "../sfu/janus_messages";
import type { StreamInfo } from "../protocol/wire";
import type { SfuFailover } from "../sfu/sfu_failover";
import { PendingConnection, type PendingConnectionOptions } from "./webrtc/pending_connection";
import type { Preconnection } from "./webrtc/preconnection";
import type { MediaSection } from "./webrtc/media_section";
import { WebRtcTransport } from "./webrtc/webrtc_transport";
import type { StampReader } from "./encoded_transform/stamp_reader";
import { TransportEnd, type Transport, type TransportEvents } from "./transport";

export type { ChannelName } from "./webrtc/data_channels";

/** What the page's link asks of connections. */
export interface PeerOptions extends PendingConnectionOptions {
  readonly watches: boolean; // the link is an observer's: the console may send it to a relay
  readonly thumbnail?: boolean; // one camera, small, without sound, nobody to be listed
}

export interface PeerEvents extends TransportEvents {
  streams(streams: readonly StreamInfo[]): void; // media come from a relay, or from another one
}

const SIGNALLING_LIMIT_MS = 20_000; // for all requests until the answer
const REQUEST_LIMIT_MS = 10_000;

/**
 * One connection to the console: its transport for messages, and where pictures and sound come from. That is the same
 * WebRTC connection, or a relay for observers. It ends once; connecting again makes a new one.
 */
export class Peer {
  id = ""; // what the console calls it; "" before it has said so
  private relay: SfuFailover | null = null; // null: media come from the console
  private readonly webrtc: WebRtcTransport;
  private transport: Transport; // `webrtc`, or a WebSocket instead of it
  private readonly abort = new AbortController();
  private isOver = false;

  /** `first`: what the page's first script has begun; null: nothing. */
  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly options: PeerOptions,
    private readonly events: PeerEvents,
    private readonly first: Preconnection | null = null,
  ) {
    const pending = first?.pending ?? new PendingConnection(reader, options);
    this.webrtc = this.transport = new WebRtcTransport(api, pending, options, this.transportEvents());
  }

  /** Returns when the answer is set; the channels open shortly after. Raises ConsoleError. */
  async connect(): Promise<void> {
    const { webrtc, options, first } = this;
    webrtc.listen();
    const signal = AbortSignal.any([this.abort.signal, AbortSignal.timeout(SIGNALLING_LIMIT_MS)]);
    // Without an answer about relays there is still the console.
    const ticket = options.watches ? await this.ticket(signal).catch(() => null) : null;
    if (options.thumbnail === true) await webrtc.connect({ kind: "thumbnail" }, signal);
    else if (ticket !== null) await this.connectBeside(ticket, signal);
    else if (first !== null) await webrtc.connect({ kind: "first", first }, signal);
    else await webrtc.connect({ kind: "media", voice: !options.watches }, signal);
  }

  /** Whether messages could be sent at some time. */
  get isConnected(): boolean {
    return this.transport.isConnected;
  }

  /** Whether no message is lost on the way. */
  get isReliable(): boolean {
    return this.transport.isReliable;
  }

  /** The relay that pictures come through now. */
  get relayName(): string | null {
    return this.relay?.name ?? null;
  }

  /** Whether pictures and feedback come from a relay. */
  get isRelayed(): boolean {
    return this.relay !== null;
  }

  /** As `Transport.send`. */
  send(channel: ChannelName, text: string): boolean {
    return this.transport.send(channel, text);
  }

  /** As `Transport.probe`. */
  probe(): void {
    this.transport.probe();
  }

  /** As `Transport.restart`. */
  async restart(): Promise<void> {
    await this.transport.restart();
  }

  /** Takes the console's STUN and TURN servers, for what is gathered from now on. Raises ConsoleError. */
  async refresh(): Promise<void> {
    const signal = AbortSignal.any([this.abort.signal, AbortSignal.timeout(REQUEST_LIMIT_MS)]);
    this.webrtc.configure(await this.api.iceServers(signal));
  }

  section(mid: string): MediaSection | undefined {
    return (this.relay ?? this.webrtc).section(mid);
  }

  /** As `WebRtcTransport.voiceSender`. */
  voiceSender(mid: string): RTCRtpSender | null {
    return this.webrtc.voiceSender(mid);
  }

  /** Ends it from here. */
  close(): void {
    this.finish(null);
  }

  /** null: this observer watches with the console itself. */
  private async ticket(signal: AbortSignal): Promise<SfuTicket | null> {
    const asked = this.api.relay("", "", signal);
    const [{ parseRelayAnswer }, answer] = await Promise.all([import("./observer_parts"), asked]);
    return parseRelayAnswer(answer);
  }

  /** Media come from the relay, everything else by a WebSocket, or by data channels where no WebSocket passes. */
  private async connectBeside(ticket: SfuTicket, signal: AbortSignal): Promise<void> {
    await this.refresh().catch(() => undefined);
    const { SfuFailover: Watch, openWebSocketTransport } = await import("./observer_parts");
    const relay = new Watch(
      this.api,
      this.reader,
      () => this.webrtc.session.servers,
      () => this.id,
      {
        feedback: (data) => this.events.message("control", data, performance.now()),
        opened: ({ streams }) => this.events.streams(streams),
        direct: () => this.finish(new TransportEnd("relay_lost", "")),
      },
    );
    this.relay = relay; // before the welcome, whose reader asks
    const socket = await openWebSocketTransport(this.api, ticket.relay, signal, this.transportEvents());
    if (socket === null) await this.webrtc.connect({ kind: "beside", relay: ticket.relay }, signal);
    else this.use(socket);
    void relay.watch();
  }

  private use(transport: Transport): void {
    this.transport = transport;
    this.webrtc.close();
    if (this.isOver) transport.close();
  }

  private transportEvents(): TransportEvents {
    const { events } = this;
    return {
      message: (channel, data, at) => events.message(channel, data, at),
      troubled: () => events.troubled(),
      ended: (end) => this.finish(end),
    };
  }

  private finish(end: TransportEnd | null): void {
    if (this.isOver) return;
    this.isOver = true;
    this.abort.abort();
    this.relay?.close();
    this.transport.close();
    if (end !== null) this.events.ended(end);
  }
}
