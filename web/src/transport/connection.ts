import { createBackoff, nextWait, noteLifetime } from "./backoff";
import {
  createReconnect,
  reconnectAlarm,
  reconnectAsked,
  reconnectHeard,
  reconnectRestarted,
  reconnectStep,
  type ReconnectAction,
} from "./reconnect";
import { connectionErrorOf, type ConnectionEnd, type ConnectionErrorKind } from "./connection_error";
import { ConsoleError, type ConsoleApi } from "./signalling/console_api";
import type { Preconnection } from "./webrtc/preconnection";
import { Peer, type ChannelName, type PeerEvents, type PeerOptions } from "./peer";
import { TransportEnd } from "./transport";
import type { ClientMessage, StreamInfo } from "../protocol/wire";
import type { StampReader } from "./encoded_transform/stamp_reader";

/** How the page stands with the console. */
export type ConnectionState =
  | { readonly kind: "no_token" }
  | {
      readonly kind: "connecting";
      readonly after?: { readonly why: ConnectionErrorKind; readonly detail: string };
    }
  | { readonly kind: "connected" }
  | { readonly kind: "ended"; readonly why: ConnectionEnd } // for good: this link opens nothing any more
  | {
      readonly kind: "waiting";
      readonly why: ConnectionErrorKind;
      readonly detail: string;
      readonly retryAtMs: number;
    };

export interface ConnectionEvents {
  state(state: ConnectionState): void;
  message(channel: ChannelName, data: unknown, at: number): void; // `at`: when it came, by performance.now()
  opened(peer: Peer): void;
  streams(peer: Peer, streams: readonly StreamInfo[]): void; // media come from a relay, or from another one
  closed(): void; // after every `opened`
}

/** Keeps one peer connected: the only layer that tries again. `first`: what the page's first script has begun. */
export class Connection {
  reconnect = createReconnect(); // of the present peer
  private readonly backoff = createBackoff();
  private peer: Peer | null = null;
  private wake: (() => void) | null = null;
  private isClosed = false;

  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly options: PeerOptions,
    private first: Preconnection | null,
    private readonly events: ConnectionEvents,
  ) {}

  /** Connects, and connects again whenever it ends, until closed. */
  async run(): Promise<void> {
    this.events.state({ kind: "connecting" });
    while (!this.closed()) {
      const trouble = await this.live();
      if (this.closed()) return;
      if (trouble.end !== undefined) {
        this.events.state({ kind: "ended", why: trouble.end });
        return;
      }
      const waitMs = Math.max(nextWait(this.backoff, Math.random()), trouble.retryAfterMs ?? 0);
      const retryAtMs = performance.now() + waitMs;
      this.events.state({ kind: "waiting", why: trouble.why, detail: trouble.detail, retryAtMs });
      await this.sleep(waitMs);
      this.events.state({ kind: "connecting", after: trouble });
    }
  }

  send(channel: ChannelName, text: string): boolean {
    return this.peer?.send(channel, text) ?? false;
  }

  /** As `send`. */
  tell(channel: ChannelName, message: ClientMessage): boolean {
    return this.send(channel, JSON.stringify(message));
  }

  /** To be called many times a second: notices silence, which WebRTC takes seconds to notice. */
  step(now: number): void {
    if (this.peer?.isConnected === true) this.act(this.peer, reconnectStep(this.reconnect, now));
  }

  /** The network changed. */
  alarm(): void {
    reconnectAlarm(this.reconnect, performance.now());
    this.peer?.probe();
    this.retryNow();
  }

  /** Tries now instead of at the end of the wait. */
  retryNow(): void {
    this.wake?.();
  }

  close(): void {
    this.isClosed = true;
    this.peer?.close();
    this.end(new TransportEnd("lost", "closed"));
    this.wake?.();
  }

  private closed(): boolean {
    return this.isClosed;
  }

  /** Ends the present connection. */
  private end: (end: TransportEnd) => void = () => undefined;

  /** One connection from its first request to its end; says what ended it. */
  private async live(): Promise<Trouble> {
    const started = performance.now();
    const ending = Promise.withResolvers<TransportEnd>();
    const events: PeerEvents = {
      message: (channel, data, at) => {
        reconnectHeard(this.reconnect, at);
        this.events.message(channel, data, at);
      },
      troubled: () => reconnectAlarm(this.reconnect, performance.now()),
      ended: (end) => ending.resolve(end),
      streams: (streams) => this.events.streams(peer, streams),
    };
    const peer: Peer = new Peer(this.api, this.reader, this.options, events, this.first);
    this.first = null;
    this.peer = peer;
    this.reconnect = createReconnect();
    this.end = (end) => ending.resolve(end);
    this.events.opened(peer);
    try {
      await peer.connect();
      const end = await ending.promise;
      if (peer.isConnected) noteLifetime(this.backoff, performance.now() - started);
      return { why: end.why, detail: end.detail, retryAfterMs: null };
    } catch (error) {
      return describe(error);
    } finally {
      this.peer = null;
      peer.close();
      this.events.closed();
    }
  }

  private act(peer: Peer, action: ReconnectAction | null): void {
    if (action === "ask") void this.ask(peer);
    else if (action === "restart") void this.restart(peer);
    else if (action === "reconnect") this.end(new TransportEnd("silent", ""));
  }

  /** Whether the console can be reached; its answer also brings TURN credentials that are good now. */
  private async ask(peer: Peer): Promise<void> {
    const askedMs = performance.now();
    const reached = await peer.refresh().then(
      () => true,
      (error: unknown) => error instanceof ConsoleError && error.status !== 0 && error.status < 500,
    );
    if (peer === this.peer)
      reconnectAsked(this.reconnect, reached, performance.now(), performance.now() - askedMs);
  }

  private async restart(peer: Peer): Promise<void> {
    const outcome = await peer.restart().then(
      () => "accepted" as const,
      (error: unknown) => (error instanceof ConsoleError && error.status === 0 ? "unanswered" : "refused"),
    );
    if (peer === this.peer) this.act(peer, reconnectRestarted(this.reconnect, outcome, performance.now()));
  }

  private async sleep(waitMs: number): Promise<void> {
    await new Promise<void>((resolve) => {
      const timer = setTimeout(resolve, waitMs);
      this.wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
    this.wake = null;
  }
}

interface Trouble {
  readonly why: ConnectionErrorKind;
  readonly detail: string;
  readonly retryAfterMs: number | null;
  readonly end?: ConnectionEnd; // trying again is no use
}

const REFUSED_MS = 5000; // a token that was refused is not refused less a moment later

function describe(error: unknown): Trouble {
  if (error instanceof TransportEnd) return { why: error.why, detail: error.detail, retryAfterMs: null };
  if (!(error instanceof ConsoleError))
    return { why: "refused", detail: error instanceof Error ? error.message : "", retryAfterMs: null };
  const { status, retryAfterMs } = error;
  const why = connectionErrorOf(status, error.error);
  if (error.error === "link_revoked" || error.error === "link_expired")
    return { why, detail: "", retryAfterMs, end: error.error };
  if (why === "token_refused") return { why, detail: "", retryAfterMs: REFUSED_MS };
  const detail = why === "refused" ? error.message : why === "robot_unreachable" ? error.detail : "";
  return { why, detail, retryAfterMs };
}
