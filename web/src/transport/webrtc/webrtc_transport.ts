import { hasTurn, type IceServer } from "../signalling/ice_servers";
import { WhepSession, type WhepApi } from "../signalling/whep_session";
import { TransportEnd, type Transport, type TransportEvents } from "../transport";
import type { ChannelName } from "./data_channels";
import type { MediaSection } from "./media_section";
import { negotiate, type Purpose } from "./negotiation";
import type { PendingConnection, PendingConnectionOptions } from "./pending_connection";

const PATH_LIMIT_MS = 10_000; // from the answer to the connection; and so many times what the answer took
const PATH_TRIPS = 10; // round trips of ICE and DTLS, some of them lost
const MOST_PATH_MS = 30_000; // the console gives up later
const MAX_WAITING = 100_000; // bytes

/** Messages, pictures and sound by WebRTC. Order: `listen`; `connect`; `close`. */
export class WebRtcTransport implements Transport {
  isConnected = false;
  readonly isReliable = false;
  readonly session: WhepSession;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private isOver = false;
  private pathLimitMs = PATH_LIMIT_MS;

  constructor(
    api: WhepApi,
    private readonly pending: PendingConnection,
    private readonly options: PendingConnectionOptions,
    private readonly events: TransportEvents,
  ) {
    this.session = new WhepSession(api);
  }

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

  /** Returns when the answer is set. Raises ConsoleError. */
  async connect(purpose: Purpose, signal: AbortSignal): Promise<void> {
    const { session, pending } = this;
    const tookMs = await negotiate(session, pending, purpose, signal);
    this.pathLimitMs = Math.min(PATH_LIMIT_MS + PATH_TRIPS * tookMs, MOST_PATH_MS);
    pending.connection.onicegatheringstatechange = () => session.trickle(pending.connection);
    session.trickle(pending.connection);
    this.limitPath();
  }

  /** Takes STUN and TURN servers, for what is gathered from now on. */
  configure(servers: readonly IceServer[]): void {
    this.session.servers = servers;
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
    const sdp = await this.session.restart(connection);
    await connection.setRemoteDescription({ type: "answer", sdp });
    this.session.trickle(connection);
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

  private connectionChanged(): void {
    const state = this.pending.connection.connectionState;
    clearTimeout(this.timer);
    if (state === "connected") this.isConnected = true;
    else if (state === "closed") this.end(new TransportEnd("lost", "the connection was closed"));
    else if (this.isConnected) this.events.troubled();
    else if (state === "failed") this.end(noPath(this.options, this.session.servers));
    else this.limitPath();
  }

  /** Ends it unless it is connected in time. */
  private limitPath(): void {
    clearTimeout(this.timer);
    if (this.isConnected) return;
    this.timer = setTimeout(() => this.end(noPath(this.options, this.session.servers)), this.pathLimitMs);
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
    this.session.end(gone);
  }
}

function noPath({ turnOnly }: PendingConnectionOptions, servers: readonly IceServer[]): TransportEnd {
  if (turnOnly) return new TransportEnd("no_turn_path", "");
  return new TransportEnd("no_path", hasTurn(servers) ? "The console's TURN server gave no path either" : "");
}
