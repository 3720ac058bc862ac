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

/** Offered before the robot's number of cameras is known; sections too many are answered inactive. */
const USUAL_CAMERAS = 2;
const CLOSED_BY_CONSOLE = "the console closed the connection";
const CONNECT_LIMIT_MS = 10_000;
const DISCONNECTED_LIMIT_MS = 4000;

/** One WebRTC connection to the console. It ends once; connecting again makes a new one. */
export class Peer {
  readonly sections: Section[] = [];
  private readonly connection = new RTCPeerConnection({ bundlePolicy: "max-bundle" });
  private readonly channels: Record<ChannelName, RTCDataChannel>;
  private readonly abort = new AbortController();
  private location = "";
  private tag = "";
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
    const media = this.api.media(signal);
    let trailer = this.addSections(USUAL_CAMERAS, 1);
    // The first offer makes the browser look for its codecs, which takes as long as the console's answer.
    const [{ cameras }, usual] = await Promise.all([media, this.connection.createOffer()]);
    const more = cameras > USUAL_CAMERAS;
    if (more) trailer = this.addSections(cameras - USUAL_CAMERAS, 0) || trailer;
    await this.connection.setLocalDescription(more ? await this.connection.createOffer() : usual);
    const offer = this.connection.localDescription?.sdp ?? "";
    const answer = await this.api.offer(offer, trailer, signal);
    this.location = answer.location;
    this.tag = answer.tag;
    if (this.isOver) throw new ConsoleError(0, "closed", "closed while connecting", null);
    await this.connection.setRemoteDescription({ type: "answer", sdp: answer.sdp });
    if (this.connection.iceGatheringState === "complete") this.sendCandidates();
    else this.connection.onicegatheringstatechange = () => this.gatheringChanged();
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
    channel.onclose = () => this.finish(CLOSED_BY_CONSOLE);
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

  private gatheringChanged(): void {
    if (this.connection.iceGatheringState === "complete" && !this.isOver) this.sendCandidates();
  }

  private endAfter(limitMs: number, why: string): void {
    clearTimeout(this.timer);
    if (this.connection.connectionState === "connected") return;
    this.timer = setTimeout(() => this.finish(why), limitMs);
  }

  /**
   * The console learns our address from our own checks (RFC 8445 7.3.1.3), so the offer does not wait for candidates.
   * Those that say more than an mDNS name follow in one fragment (RFC 8840).
   */
  private sendCandidates(): void {
    const offer = this.connection.localDescription?.sdp ?? "";
    const lines = offer.split(/\r?\n/);
    const candidates = lines.filter((line) => line.startsWith("a=candidate:") && !line.includes(".local "));
    if (this.location === "" || candidates.length === 0) return;
    const head = ["a=ice-ufrag:", "a=ice-pwd:", "a=mid:"].map(
      (name) => lines.find((line) => line.startsWith(name)) ?? "",
    );
    const fragment = [...head, ...new Set(candidates), "a=end-of-candidates", ""].join("\r\n");
    // Only a help: without them the connection is still found.
    this.api.trickle(this.location, this.tag, fragment).catch(() => undefined);
  }

  private finish(why: string | null): void {
    if (this.isOver) return;
    this.isOver = true;
    clearTimeout(this.timer);
    this.abort.abort();
    for (const { stamps } of this.sections) if (stamps !== null) this.reader?.detach(stamps);
    this.connection.close();
    // The console notices a lost peer by itself; asking it to end the session only makes that quicker.
    if (why !== CLOSED_BY_CONSOLE) this.api.end(this.location).catch(() => undefined);
    if (why !== null) this.events.ended(why);
  }
}
