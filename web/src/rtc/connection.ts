import { createBackoff, nextWait, noteLifetime } from "../core/backoff";
import { ConsoleError, type ConsoleApi } from "./console_api";
import { Peer, type ChannelName } from "./peer";
import type { StampReader } from "./stamp_reader";

/** How the page stands with the console. */
export type LinkState =
  | { readonly kind: "no_token" }
  | { readonly kind: "connecting" }
  | { readonly kind: "connected" }
  | { readonly kind: "ended"; readonly why: LinkEnd } // for good: this link opens nothing any more
  | {
      readonly kind: "waiting";
      readonly why: LinkTrouble;
      readonly detail: string;
      readonly retryAtMs: number;
    };

export type LinkEnd = "link_revoked" | "link_expired";

export type LinkTrouble = "console_unreachable" | "robot_unreachable" | "token_refused" | "refused" | "lost";

export interface ConnectionEvents {
  state(state: LinkState): void;
  message(channel: ChannelName, data: unknown): void;
  opened(peer: Peer): void;
  closed(): void; // after every `opened`
}

/** Keeps one peer connected: the only layer that tries again. */
export class Connection {
  private readonly backoff = createBackoff();
  private peer: Peer | null = null;
  private wake: (() => void) | null = null;
  private isClosed = false;

  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly trailer: boolean,
    private readonly events: ConnectionEvents,
  ) {}

  /** Connects, and connects again whenever it ends, until closed. */
  async run(): Promise<void> {
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
    }
  }

  send(channel: ChannelName, text: string): boolean {
    return this.peer?.send(channel, text) ?? false;
  }

  /** Ends the present peer as lost, when its silence shows what WebRTC has not noticed yet. */
  drop: (why: string) => void = () => undefined;

  /** Tries now instead of at the end of the wait. */
  retryNow(): void {
    this.wake?.();
  }

  close(): void {
    this.isClosed = true;
    this.peer?.close();
    this.drop("closed");
    this.wake?.();
  }

  private closed(): boolean {
    return this.isClosed;
  }

  /** One connection from its first request to its end; says what ended it. */
  private async live(): Promise<Trouble> {
    this.events.state({ kind: "connecting" });
    const started = performance.now();
    const ending = Promise.withResolvers<string>();
    const peer = new Peer(
      this.api,
      this.reader,
      {
        message: (channel, data) => this.events.message(channel, data),
        ended: (why) => ending.resolve(why),
      },
      this.trailer,
    );
    this.peer = peer;
    this.drop = (why) => ending.resolve(why);
    this.events.opened(peer);
    try {
      await peer.connect();
      const detail = await ending.promise;
      noteLifetime(this.backoff, performance.now() - started);
      return { why: "lost", detail, retryAfterMs: null };
    } catch (error) {
      return troubleOf(error);
    } finally {
      this.peer = null;
      peer.close();
      this.events.closed();
    }
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
  readonly why: LinkTrouble;
  readonly detail: string;
  readonly retryAfterMs: number | null;
  readonly end?: LinkEnd; // trying again is no use
}

function troubleOf(error: unknown): Trouble {
  if (!(error instanceof ConsoleError)) {
    return { why: "refused", detail: error instanceof Error ? error.message : "", retryAfterMs: null };
  }
  const { status, detail, retryAfterMs } = error;
  if (status === 0) return { why: "console_unreachable", detail: "", retryAfterMs };
  if (error.error === "robot_unreachable") return { why: "robot_unreachable", detail, retryAfterMs };
  if (error.error === "link_revoked" || error.error === "link_expired")
    return { why: "token_refused", detail, retryAfterMs, end: error.error };
  if (status === 401 || status === 403) return { why: "token_refused", detail, retryAfterMs: 5000 };
  return { why: "refused", detail: error.message, retryAfterMs };
}
