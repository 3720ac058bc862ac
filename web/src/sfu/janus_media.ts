import { completeOffer, feedMids, wantedMids, type SfuTicket } from "./janus_messages";
import type { IceServer } from "../transport/signalling/ice_servers";
import { askForCaptureTime } from "../transport/webrtc/header_extensions";
import { JanusSocket } from "./janus_socket";
import { receivedSection, type MediaSection } from "../transport/webrtc/media_section";
import { SilenceTimeout } from "../transport/silence_timeout";
import type { StampReader } from "../transport/encoded_transform/stamp_reader";

export interface SfuMediaEvents {
  feedback(data: unknown): void;
  lost(why: string): void; // once, unless closed from here
}

/** Pictures, sound and feedback through a Janus. It ends once. */
export class JanusMedia {
  readonly sections = new Map<string, MediaSection>(); // by the publisher's mid
  private readonly connection: RTCPeerConnection;
  private readonly socket: JanusSocket;
  private readonly silence = new SilenceTimeout(() => this.lose("the relay fell silent"));
  private isOver = false;

  constructor(
    readonly ticket: SfuTicket,
    private readonly reader: StampReader | null,
    servers: readonly IceServer[],
    private readonly events: SfuMediaEvents,
  ) {
    const iceServers = servers.map((server) => ({ ...server, urls: [...server.urls] }));
    this.connection = new RTCPeerConnection({ bundlePolicy: "max-bundle", iceServers });
    this.connection.onconnectionstatechange = () => {
      if (this.connection.connectionState === "failed") this.lose("no path to the relay");
    };
    this.connection.ondatachannel = ({ channel }) => this.listen(channel);
    // A Janus tells a subscriber of data only when the subscriber has a channel of its own.
    this.listen(this.connection.createDataChannel("feedback", { ordered: false, maxRetransmits: 0 }));
    this.socket = new JanusSocket(ticket.url, (why) => this.lose(why));
  }

  /** Returns when pictures are on their way, and says then what it has; raises Error. */
  async open(): Promise<void> {
    const { ticket } = this;
    await this.socket.begin();
    const streams = wantedMids(ticket).map((mid) => ({ feed: ticket.feed, mid }));
    const join = { request: "join", ptype: "subscriber", room: ticket.room, pin: ticket.pin, streams };
    const { sdp, data } = await this.socket.message(join, null);
    if (sdp === null) throw new Error("the relay sent no offer");
    await this.connection.setRemoteDescription({ type: "offer", sdp: completeOffer(sdp) });
    this.readStamps(feedMids(data));
    await this.connection.setLocalDescription(await this.connection.createAnswer());
    await this.gathered();
    await this.socket.message({ request: "start" }, this.connection.localDescription?.sdp ?? "");
  }

  close(): void {
    this.isOver = true;
    this.silence.close();
    for (const { stamps } of this.sections.values()) if (stamps !== null) this.reader?.detach(stamps);
    this.socket.close();
    this.connection.close();
  }

  private readStamps(mids: ReadonlyMap<string, string>): void {
    const kinds = new Map(this.ticket.streams.map((stream) => [stream.mid, stream.kind]));
    for (const transceiver of this.connection.getTransceivers()) {
      const mid = mids.get(transceiver.mid ?? "");
      const kind = kinds.get(mid ?? "");
      if (mid === undefined || kind === undefined) continue;
      askForCaptureTime(transceiver, kind); // playout-delay, which a Janus hands on
      const stamps = this.reader?.attach(transceiver.receiver, kind, true) ?? null;
      this.sections.set(mid, receivedSection(kind, transceiver.receiver, stamps));
    }
  }

  /** A Janus takes candidates one by one too, but those of this device are known at once. */
  private async gathered(): Promise<void> {
    const { connection } = this;
    if (connection.iceGatheringState === "complete") return;
    await new Promise<void>((resolve) => {
      const timer = setTimeout(resolve, 500); // a STUN server that does not answer
      connection.onicegatheringstatechange = () => {
        if (connection.iceGatheringState !== "complete") return;
        clearTimeout(timer);
        resolve();
      };
    });
  }

  private listen(channel: RTCDataChannel): void {
    channel.onmessage = (event: MessageEvent<unknown>) => {
      this.silence.heard();
      this.events.feedback(event.data);
    };
  }

  private lose(why: string): void {
    if (this.isOver) return;
    this.close();
    this.events.lost(why);
  }
}
