import { AGREED_CHANNELS, withChannels, type ChannelName } from "./data_channels";
import type { IceServer } from "../signalling/ice_servers";
import { preferCodecs } from "./codec_preference";
import { askForCaptureTime } from "./header_extensions";
import { receivedSection, type MediaSection } from "./media_section";
import { SourceStamps, noteUnreadable, sourcesTell } from "./source_stamps";
import type { StampReader } from "../encoded_transform/stamp_reader";
import type { WhepAnswer } from "../signalling/whep";

/** What a link asks of its connections to the console. */
export interface PendingConnectionOptions {
  readonly trailer: boolean; // the event reference travels in trailers
  readonly turnOnly: boolean; // through TURN or not at all
}

export interface OfferedSection extends MediaSection {
  readonly transceiver: RTCRtpTransceiver;
}

/** Whoever listens; `at`: when the message came, by performance.now(). */
export type OnMessage = (channel: ChannelName, data: unknown, at: number) => void;

interface EarlyMessage {
  readonly channel: ChannelName;
  readonly data: unknown;
  readonly at: number;
}

const MAX_EARLY_CONTROL = 64; // of `control`: feedback, of which the newest counts
const MAX_EARLY = 1000; // of the others, which all count: more end the connection

/** Sections that nobody has to ask for first: most robots have no more cameras and microphones. */
export const USUAL_CAMERAS = 2;
export const USUAL_MICROPHONES = 1;

/**
 * A WebRTC connection to the console up to its answer. Whoever owns it closes it. What it hears before somebody listens
 * it keeps: the page's first script opens one while the rest of the page is loaded.
 */
export class PendingConnection {
  readonly connection: RTCPeerConnection;
  readonly channels: Readonly<Record<ChannelName, RTCDataChannel>>;
  readonly sections: OfferedSection[] = [];
  voice: RTCRtpTransceiver | null = null; // nothing is sent in it before somebody talks
  onunreadable: (() => void) | null = null; // no picture has a stamp here: the next connection reads them otherwise
  private early: EarlyMessage[] = [];
  private heard: OnMessage | null = null;
  private made: RTCSessionDescriptionInit | null = null; // the newest offer
  private takesTrailer: boolean;

  constructor(
    readonly reader: StampReader | null,
    private readonly options: PendingConnectionOptions,
    servers: readonly IceServer[] = [],
  ) {
    this.takesTrailer = options.trailer;
    this.connection = new RTCPeerConnection(this.configuration(servers));
    this.channels = {
      control: this.open("control"),
      session: this.open("session"),
      stop: this.open("stop"),
    };
  }

  /** For media to receive. */
  addSections(cameras: number, microphones: number): void {
    const kinds = [...Array<"video">(cameras).fill("video"), ...Array<"audio">(microphones).fill("audio")];
    const transceivers = kinds.map((kind) => this.connection.addTransceiver(kind, { direction: "recvonly" }));
    for (const transceiver of transceivers.slice(0, cameras)) preferCodecs(transceiver);
    const offered = transceivers.map((transceiver, index) =>
      askForCaptureTime(transceiver, kinds[index] ?? "video"),
    );
    this.takesTrailer ||= offered.includes(false);
    for (const [index, transceiver] of transceivers.entries()) {
      const kind = kinds[index] ?? "video";
      this.sections.push({ ...this.marked(kind, transceiver.receiver), transceiver });
    }
  }

  private marked(kind: "audio" | "video", receiver: RTCRtpReceiver): MediaSection {
    if (this.reader !== null && kind === "video" && !this.takesTrailer && sourcesTell())
      return receivedSection(kind, receiver, null, new SourceStamps(receiver, () => this.unreadable()));
    return receivedSection(kind, receiver, this.reader?.attach(receiver, kind, this.takesTrailer) ?? null);
  }

  private unreadable(): void {
    noteUnreadable();
    this.onunreadable?.();
  }

  /** For this person's voice; a console without a loudspeaker leaves it inactive. */
  addVoice(): void {
    this.voice = this.connection.addTransceiver("audio", { direction: "sendonly" });
  }

  /** What is to be posted, and the query of the URL. Nothing is gathered before the answer names STUN and TURN servers. */
  async offer(): Promise<{ readonly sdp: string; readonly query: string }> {
    this.made = await this.connection.createOffer();
    return { sdp: withChannels(this.made.sdp ?? ""), query: this.takesTrailer ? "stamp=trailer" : "" };
  }

  async take(answer: Pick<WhepAnswer, "sdp" | "servers">): Promise<void> {
    this.configure(answer.servers);
    if (this.made !== null) await this.connection.setLocalDescription(this.made);
    await this.connection.setRemoteDescription({ type: "answer", sdp: answer.sdp });
  }

  /** STUN and TURN servers for what is gathered from now on. */
  configure(servers: readonly IceServer[]): void {
    this.connection.setConfiguration(this.configuration(servers));
  }

  /** From now on; what has come before is heard at once. */
  listen(heard: OnMessage): void {
    this.heard = heard;
    for (const { channel, data, at } of this.early.splice(0)) heard(channel, data, at);
  }

  close(): void {
    this.early = [];
    this.heard = () => undefined;
    for (const { stamps } of this.sections) if (stamps !== null) this.reader?.detach(stamps);
    this.connection.close();
  }

  private open(name: ChannelName): RTCDataChannel {
    const { id, options } = AGREED_CHANNELS[name];
    const channel = this.connection.createDataChannel(name, { ...options, negotiated: true, id });
    channel.onmessage = (event: MessageEvent<unknown>) => this.received(name, event.data);
    return channel;
  }

  private received(channel: ChannelName, data: unknown): void {
    const at = performance.now();
    if (this.heard !== null) this.heard(channel, data, at);
    else this.keep({ channel, data, at });
  }

  private keep(message: EarlyMessage): void {
    const isControl = message.channel === "control";
    const same = this.early.filter(({ channel }) => (channel === "control") === isControl);
    const [oldest] = same;
    if (isControl && oldest !== undefined && same.length >= MAX_EARLY_CONTROL)
      this.early.splice(this.early.indexOf(oldest), 1);
    this.early.push(message);
    if (!isControl && same.length >= MAX_EARLY) this.close();
  }

  private configuration(servers: readonly IceServer[]): RTCConfiguration {
    const iceServers = servers.map((server) => ({ ...server, urls: [...server.urls] }));
    const iceTransportPolicy = this.options.turnOnly ? "relay" : "all";
    return { bundlePolicy: "max-bundle", iceServers, iceTransportPolicy };
  }
}
