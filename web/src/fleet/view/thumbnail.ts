import { applyMessage, createConsoleState, forgetConnection, robotIsUp } from "../../session/console_state";
import { ageLabel, STALE_MS } from "../../drive/feedback_age";
import { sourceLabel } from "../../session/source_labels";
import { staleness } from "../../gate/staleness";
import { CONNECTION_END_LABELS, CONNECTION_ERROR_LABELS } from "../../transport/connection_error";
import { parseServerMessage } from "../../protocol/wire_parser";
import type { AudioDevice } from "../../media/sound/audio_device";
import type { VideoStream } from "../../media/video_stream";
import { MediaStreams } from "../../media/media_streams";
import { Heartbeat } from "../../transport/heartbeat";
import { Connection, type ConnectionState } from "../../transport/connection";
import type { ConsoleApi } from "../../transport/signalling/console_api";
import type { Peer, PeerOptions } from "../../transport/peer";
import type { StampReader } from "../../transport/encoded_transform/stamp_reader";
import type { ServerMessage } from "../../protocol/wire";

const OPENING_MS = 4000;

/** One robot's first camera, small, behind the same gate as on the robot's own page. */
export class Thumbnail {
  private readonly state = createConsoleState();
  private readonly room: MediaStreams;
  private readonly connection: Connection;
  private readonly heartbeat: Heartbeat;
  private peer: Peer | null = null;
  private link: ConnectionState = { kind: "connecting" };
  private heardMs = 0;
  private readonly openedMs = performance.now();

  /** `changed`: a picture was drawn, or became stale. */
  constructor(
    api: ConsoleApi,
    reader: StampReader | null,
    silence: AudioDevice, // nothing is ever played on it
    options: PeerOptions,
    private readonly canvas: HTMLCanvasElement,
    private readonly changed: () => void,
  ) {
    this.room = new MediaStreams(this.state, reader, silence, {
      canvas: () => this.canvas,
      visible: () => !document.hidden,
      drawn: () => this.changed(),
    });
    this.connection = new Connection(api, reader, { ...options, watches: false, thumbnail: true }, null, {
      state: (link) => (this.link = link),
      message: (_channel, data) => this.received(data),
      opened: (peer) => (this.peer = peer),
      streams: () => undefined, // thumbnails come from the console itself
      closed: () => this.closed(),
    });
    this.heartbeat = new Heartbeat({
      tell: (message) => this.connection.tell("control", message),
      report: () => ({ type: "report", event: this.state.feedback?.event ?? 0 }),
      lost: () => undefined,
    });
    this.heartbeat.observes = true;
    void this.connection.run();
  }

  /** Its pictures; null before they come. */
  get video(): VideoStream | null {
    return [...this.room.videos.values()][0] ?? null;
  }

  /** Events that a picture may be away from the feedback. */
  get tolerance(): number {
    return this.state.settings.tolerance.video;
  }

  /** Whether it is on its first way to the console. One that does not get there keeps nobody waiting. */
  isOpening(now: number): boolean {
    return !this.isConnected && now - this.openedMs < OPENING_MS;
  }

  /** To be called many times a second. */
  step(now: number): void {
    if (this.isConnected) this.heartbeat.step(now);
    this.connection.step(now);
  }

  /** Why what the canvas has is not the robot's present state; null when it is. */
  veil(now: number): string | null {
    if (!this.isConnected) return linkWords(this.link);
    const silentMs = now - this.heardMs;
    if (silentMs > STALE_MS) return `Silent for ${ageLabel(silentMs)}`;
    if (this.state.robot !== null && !robotIsUp(this.state)) return "Robot unreachable";
    const { video } = this;
    if (video === null) return "No camera";
    const source = this.state.sources.find((each) => each.stream === video.info.stream);
    const troubled = source === undefined ? null : sourceLabel(source);
    if (troubled !== null) return troubled;
    return staleness(video.gate.shown, video.lastDrawnMs, video.lastGoodMs, this.room.context("video"), now);
  }

  /** STOP by this way too: it may be open where HTTP is not. */
  stop(reason: string, press: string): void {
    const text = JSON.stringify({ type: "stop", by: "", reason, press });
    this.connection.send("stop", text);
    this.connection.send("control", text);
  }

  /** The network changed. */
  alarm(): void {
    this.connection.alarm();
  }

  /** Ends it and leaves nothing on the canvas that somebody could take for the present. */
  close(): void {
    this.connection.close();
    this.room.close();
    this.canvas.getContext("2d", { alpha: false })?.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  private get isConnected(): boolean {
    return this.state.welcome !== null;
  }

  private closed(): void {
    this.peer = null;
    this.heartbeat.end();
    this.room.close();
    forgetConnection(this.state);
    this.changed();
  }

  private received(data: unknown): void {
    const parsed = parseServerMessage(data);
    if (parsed.kind !== "message") return;
    this.heardMs = performance.now();
    applyMessage(this.state, parsed.message, Date.now());
    this.follow(parsed.message);
  }

  private follow(message: ServerMessage): void {
    if (message.type === "welcome") {
      this.link = { kind: "connected" };
      if (this.peer !== null) this.room.open(this.peer, message.streams);
    } else if (message.type === "pong") this.heartbeat.answered(message.id, this.heardMs);
    else if (message.type === "feedback" && this.state.feedback === message) {
      this.room.changed();
      this.changed();
    }
  }
}

function linkWords(link: ConnectionState): string {
  switch (link.kind) {
    case "no_token":
    case "connecting":
    case "connected":
      return "Connecting …";
    case "waiting":
      return CONNECTION_ERROR_LABELS[link.why].title;
    case "ended":
      return CONNECTION_END_LABELS[link.why].title;
  }
}
