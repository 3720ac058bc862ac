import type { IceServer } from "../transport/signalling/ice_servers";
import { parseRelayAnswer, type SfuTicket } from "./janus_messages";
import type { ConsoleApi } from "../transport/signalling/console_api";
import { JanusMedia } from "./janus_media";
import type { MediaSection } from "../transport/webrtc/media_section";
import type { StampReader } from "../transport/encoded_transform/stamp_reader";

const RETRY_MS = 500;
const REQUEST_LIMIT_MS = 10_000;
const WELCOME_MS = 20; // between two looks whether the welcome has come

export interface SfuFailoverEvents {
  feedback(data: unknown): void;
  opened(ticket: SfuTicket): void; // once per relay
  direct(): void; // no relay is left: watch at the console
}

/** Keeps an observer's media coming through one relay or another. The connection to the console lives on meanwhile. */
export class SfuFailover {
  private media: JanusMedia | null = null;
  private isOver = false;

  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly servers: () => readonly IceServer[],
    private readonly peer: () => string,
    private readonly events: SfuFailoverEvents,
  ) {}

  /** Until it is closed, or no relay is left. The console says what lets into one only to a peer that is connected. */
  async watch(): Promise<void> {
    let next = await this.another(null);
    while (next !== null && !this.isOver) {
      await this.through(next);
      next = await this.another(next);
    }
    if (!this.isOver) this.events.direct();
  }

  /** As the console counts its relays. */
  get name(): string | null {
    return this.media?.ticket.relay ?? null;
  }

  section(mid: string): MediaSection | undefined {
    return this.media?.sections.get(mid);
  }

  close(): void {
    this.isOver = true;
    this.media?.close();
    this.wake();
  }

  private wake: () => void = () => undefined;

  /** One relay, from its first request to its end. */
  private async through(ticket: SfuTicket): Promise<void> {
    const lost = Promise.withResolvers<null>();
    this.wake = () => lost.resolve(null);
    try {
      this.media = new JanusMedia(ticket, this.reader, this.servers(), {
        feedback: (data) => this.events.feedback(data),
        lost: () => lost.resolve(null),
      });
      await this.media.open();
      if (!this.isOver) this.events.opened(ticket);
      await lost.promise;
    } catch {
      // The relay cannot be used: the console names another one.
    }
    this.media?.close();
  }

  private async another(lost: SfuTicket | null): Promise<SfuTicket | null> {
    for (let waitMs = 0; !this.isOver; waitMs = RETRY_MS) {
      if (waitMs > 0) await new Promise((resolve) => setTimeout(resolve, waitMs)); // the console is away too
      await this.connected();
      const limit = AbortSignal.timeout(REQUEST_LIMIT_MS);
      const answer = this.api.relay(this.peer(), lost === null ? "" : `${lost.relay}-${lost.feed}`, limit);
      const ticket = await answer.then(parseRelayAnswer).catch(() => undefined);
      if (ticket !== undefined && (ticket === null || ticket.pin !== "")) return ticket;
    }
    return null;
  }

  /** Returns when the console has said which peer this is, or when it is over. */
  private async connected(): Promise<void> {
    while (!this.isOver && this.peer() === "")
      await new Promise((resolve) => setTimeout(resolve, WELCOME_MS));
  }
}
