import type { IceServer } from "../core/ice_servers";
import type { RelayTicket } from "../core/relay";
import { JanusMedia } from "./relay_media";
import type { Section } from "./section";
import type { StampReader } from "./stamp_reader";

export interface RelayEvents {
  feedback(data: unknown): void;
  lost(why: string): void; // once, unless closed from here
}

/** Pictures, sound and feedback through one relay. It ends once. */
export interface RelayLink {
  readonly ticket: RelayTicket;
  readonly sections: ReadonlyMap<string, Section>; // by the publisher's mid

  /** Returns when pictures are on their way; raises Error. */
  open(): Promise<void>;
  close(): void;
}

/** LiveKit's client is as large as the rest of the page: only who needs it loads it. */
export async function relayLink(
  ticket: RelayTicket,
  reader: StampReader | null,
  servers: readonly IceServer[],
  events: RelayEvents,
): Promise<RelayLink> {
  if (ticket.engine === "janus") return new JanusMedia(ticket, reader, servers, events);
  const { LiveKitMedia } = await import("./livekit_media");
  return new LiveKitMedia(ticket, reader, servers, events);
}
