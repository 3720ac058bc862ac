import type { ServerMessage } from "../protocol/wire";
import type { ChannelName } from "../transport/webrtc/data_channels";

interface LateMessage {
  readonly channel: ChannelName;
  readonly message: ServerMessage;
  readonly atMs: number;
}

/** What is wrong with a message of this type; null: it fits. */
export type Misfit = (type: string, message: unknown) => string | null;

const TYPES = /^(episode|episode_answer|navigation|shadow_verdict|traces)$/;

/** Messages whose schema comes with later code, and the takers of them, which come with it. */
export class LateInbox {
  readonly newest = new Map<string, LateMessage>(); // by type; unread until the schema is there
  readonly take: Record<string, (message: ServerMessage) => void> = {};
  private misfit: Misfit | null = null;

  constructor(private readonly unreadable: (channel: ChannelName, detail: string) => void) {}

  /** Returns false for a message of another type. */
  received(channel: ChannelName, type: string, value: unknown, atMs: number): boolean {
    if (!TYPES.test(type)) return false;
    // The schema is generated together with the type; a taker, and whoever asks for the newest, comes after the schema.
    const message = value as ServerMessage;
    if (this.fits(channel, type, message)) {
      this.newest.set(type, { channel, message, atMs });
      this.take[type]?.(message);
    }
    return true;
  }

  /** The schema is there. To be called before there are takers. */
  read(misfit: Misfit): void {
    this.misfit = misfit;
    for (const [type, { channel, message }] of this.newest)
      if (!this.fits(channel, type, message)) this.newest.delete(type);
  }

  private fits(channel: ChannelName, type: string, message: unknown): boolean {
    const detail = this.misfit?.(type, message) ?? null;
    if (detail !== null) this.unreadable(channel, detail);
    return detail === null;
  }
}
