import { ConsoleError, type ConsoleApi } from "./console_api";
import { askForCaptureTime } from "./header_extensions";
import type { ReceiverStamps, StampReader } from "./stamp_reader";

export type ChannelName = "control" | "session" | "stop";

/** One media section and the stamps of its frames. */
export interface Section {
  readonly kind: "audio" | "video";
  readonly transceiver: RTCRtpTransceiver;
  readonly stamps: ReceiverStamps | null; // null where the browser has no transforms
}

export interface PeerEvents {
  message(channel: ChannelName, data: unknown): void;
  ended(why: string): void; // once, unless closed from here
}

const GATHER_LIMIT_MS = 300;
const CONNECT_LIMIT_MS = 10_000;
const DISCONNECTED_LIMIT_MS = 4000;

/** One WebRTC connection to the console. It ends once; connecting again makes a new one. */
export class Peer {
  readonly sections: Section[] = [];
  private readonly connection = new RTCPeerConnection({ bundlePolicy: "max-bundle" });
  private readonly channels: Record<ChannelName, RTCDataChannel>;
  private readonly abort = new AbortController();
  private location = "";
  private timer: ReturnType<typeof setTimeout> | undefined;
  private isOver = false;

  constructor(
    private readonly api: ConsoleApi,
    private readonly reader: StampReader | null,
    private readonly events: PeerEvents,
    private readonly trailerWanted: boolean,
  ) {
    this.channels = {
      control: this.openChannel("control", { ordered: false, maxRetransmits: 0 }),
      session: this.openChannel("session", {}),
      stop: this.openChannel("stop", {}),
    };
    this.connection.onconnectionstatechange = () => this.connectionChanged();
  }

  /** Returns when the answer is set; the channels open shortly after. Raises ConsoleError. */
  async connect(): Promise<void> {
    const signal = AbortSignal.any([this.abort.signal, AbortSignal.timeout(CONNECT_LIMIT_MS)]);
    const { cameras, microphones } = await this.api.media(signal);
    const trailer = this.addSections(cameras, microphones);
    await this.connection.setLocalDescription(await this.connection.createOffer());
    await this.gathered();
    const offer = this.connection.localDescription?.sdp ?? "";
    const answer = await this.api.offer(offer, trailer, signal);
    this.location = answer.location;
    if (this.isOver) throw new ConsoleError(0, "closed", "closed while connecting", null);
    await this.connection.setRemoteDescription({ type: "answer", sdp: answer.sdp });
    this.endAfter(CONNECT_LIMIT_MS, "no connection: is UDP blocked?");
  }

  /** Says whether it could be sent. What cannot go out now is not kept: newer follows. */
  send(channel: ChannelName, text: string): boolean {
    const target = this.channels[channel];
    if (target.readyState !== "open" || target.bufferedAmount > 100_000) return false;
    try {
      target.send(text);
      return true;
    } catch {
      return false; // closed between the look and the call
    }
  }

  section(mid: string): Section | undefined {
    return this.sections.find((section) => section.transceiver.mid === mid);
  }

  /** Ends it from here; the session is deleted, also while the page is being left. */
  close(): void {
    this.finish(null);
  }

  private addSections(cameras: number, microphones: number): boolean {
    const kinds = [...Array<"video">(cameras).fill("video"), ...Array<"audio">(microphones).fill("audio")];
    const transceivers = kinds.map((kind) => this.connection.addTransceiver(kind, { direction: "recvonly" }));
    const offered = transceivers.map((transceiver, index) =>
      askForCaptureTime(transceiver, kinds[index] ?? "video"),
    );
    const trailer = this.trailerWanted || offered.includes(false);
    for (const [index, transceiver] of transceivers.entries()) {
      const kind = kinds[index] ?? "video";
      const stamps = this.reader?.attach(transceiver.receiver, kind, trailer) ?? null;
      this.sections.push({ kind, transceiver, stamps });
    }
    return trailer;
  }

  private openChannel(name: ChannelName, options: RTCDataChannelInit): RTCDataChannel {
    const channel = this.connection.createDataChannel(name, options);
    channel.onmessage = (event: MessageEvent<unknown>) => this.events.message(name, event.data);
    channel.onclose = () => this.finish("the console closed the connection");
    return channel;
  }

  private connectionChanged(): void {
    const state = this.connection.connectionState;
    clearTimeout(this.timer);
    if (state === "failed") this.finish("the connection failed");
    else if (state === "closed") this.finish("the connection was closed");
    else if (state === "disconnected") this.endAfter(DISCONNECTED_LIMIT_MS, "the connection was lost");
    else if (state !== "connected") this.endAfter(CONNECT_LIMIT_MS, "no connection: is UDP blocked?");
  }

  private endAfter(limitMs: number, why: string): void {
    clearTimeout(this.timer);
    if (this.connection.connectionState === "connected") return;
    this.timer = setTimeout(() => this.finish(why), limitMs);
  }

  /** Candidates go with the offer: the console needs only one that works, and here they come in milliseconds. */
  private async gathered(): Promise<void> {
    const { connection } = this;
    if (connection.iceGatheringState === "complete") return;
    await new Promise<void>((resolve) => {
      const timer = setTimeout(resolve, GATHER_LIMIT_MS);
      connection.onicegatheringstatechange = () => {
        if (connection.iceGatheringState !== "complete") return;
        clearTimeout(timer);
        resolve();
      };
    });
  }

  private finish(why: string | null): void {
    if (this.isOver) return;
    this.isOver = true;
    clearTimeout(this.timer);
    this.abort.abort();
    for (const { stamps } of this.sections) if (stamps !== null) this.reader?.detach(stamps);
    this.connection.close();
    // The console notices a lost peer by itself; asking it to end the session only makes that quicker.
    this.api.end(this.location).catch(() => undefined);
    if (why !== null) this.events.ended(why);
  }
}
