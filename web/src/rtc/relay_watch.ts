import type { IceServer } from "../core/ice_servers";
import type { RelayTicket } from "../core/relay";
import type { ConsoleApi } from "./console_api";
import { relayLink, type RelayLink } from "./relay_link";
import type { Section } from "./section";
import type { StampReader } from "./stamp_reader";

const RETRY_MS = 500;
const REQUEST_LIMIT_MS = 10_000;

export interface RelayWatchEvents {
  feedback(data: unknown): void;
  opened(ticket: RelayTicket): void; // once per relay
  direct(): void; // no relay is left: watch at the console
}

/** Keeps an observer's media coming through one relay or another. The connection to the console lives on meanwhile. */
export class RelayWatch {
  private media: RelayLink | null = null;
  private isOver = false;

  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly servers: () => readonly IceServer[],
    private readonly peer: () => string,
    private readonly events: RelayWatchEvents,
  ) {}

  /** Until it is closed, or no relay is left. */
  async watch(ticket: RelayTicket): Promise<void> {
    let next: RelayTicket | null = ticket;
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

  section(mid: string): Section | undefined {
    return this.media?.sections.get(mid);
  }

  close(): void {
    this.isOver = true;
    this.media?.close();
    this.wake();
  }

  private wake: () => void = () => undefined;

  /** One relay, from its first request to its end. */
  private async through(ticket: RelayTicket): Promise<void> {
    const lost = Promise.withResolvers<null>();
    this.wake = () => lost.resolve(null);
    try {
      this.media = await relayLink(ticket, this.reader, this.servers(), {
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

  private async another(lost: RelayTicket): Promise<RelayTicket | null> {
    while (!this.isOver) {
      try {
        const limit = AbortSignal.timeout(REQUEST_LIMIT_MS);
        return await this.api.relay(this.peer(), `${lost.relay}-${lost.feed}`, limit);
      } catch {
        await new Promise((resolve) => setTimeout(resolve, RETRY_MS)); // the console is away too
      }
    }
    return null;
  }
}
