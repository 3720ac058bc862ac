import {
  LogLevel,
  Room,
  RoomEvent,
  Track,
  setLogLevel,
  type RemoteTrack,
  type RemoteTrackPublication,
} from "livekit-client";
import type { IceServer } from "../core/ice_servers";
import type { LiveKitTicket } from "../core/relay";
import { splitSounds } from "../core/sound_packets";
import { markOfTrailer, splitTrailer } from "../core/trailer";
import type { RelayEvents, RelayLink } from "./relay_link";
import { receivedSection, type Section } from "./section";
import { SilenceWatch } from "./silence_watch";
import { createStamps, notePacket, type ReceiverStamps, type StampReader } from "./stamp_reader";

const OPEN_MS = 6000;

/** Pictures, sound and feedback through a LiveKit. It ends once; trying again is not its client's business. */
export class LiveKitMedia implements RelayLink {
  readonly sections = new Map<string, Section>();
  private readonly sounds = new Map<number, ReceiverStamps>();
  private readonly room: Room;
  private readonly silence = new SilenceWatch(() => this.lose("the relay fell silent"));
  private readonly complete = Promise.withResolvers<null>();
  private isOver = false;

  constructor(
    readonly ticket: LiveKitTicket,
    private readonly reader: StampReader | null,
    private readonly servers: readonly IceServer[],
    private readonly events: RelayEvents,
  ) {
    setLogLevel(LogLevel.error);
    this.room = new Room({
      disconnectOnPageLeave: true,
      reconnectPolicy: { nextRetryDelayInMs: () => null }, // the console knows where to go next
    });
    this.room.on(RoomEvent.TrackPublished, (publication, { identity }) => this.want(publication, identity));
    this.room.on(RoomEvent.TrackSubscribed, (track, publication, { identity }) => {
      if (identity === ticket.publisher && track.kind === Track.Kind.Video)
        this.received(track, publication.trackName);
    });
    this.room.on(RoomEvent.DataReceived, (payload, participant, _kind, topic) => {
      if (participant?.identity === ticket.publisher) this.heard(payload, topic ?? "");
    });
    this.room.on(RoomEvent.Disconnected, () => this.lose("the connection to the relay was closed"));
    for (const { kind, mid, codec } of ticket.streams) {
      if (kind !== "audio" || (codec !== "PCMU" && !("AudioDecoder" in globalThis))) continue;
      const stamps = createStamps(true);
      this.sounds.set(Number(mid), stamps);
      this.sections.set(mid, { kind, track: null, stamps, playing: () => undefined });
    }
  }

  async open(): Promise<void> {
    const timer = setTimeout(() => this.complete.reject(new Error("nothing comes from the relay")), OPEN_MS);
    try {
      await Promise.all([this.join(), this.complete.promise]);
    } finally {
      clearTimeout(timer);
    }
  }

  close(): void {
    this.isOver = true;
    this.silence.close();
    this.complete.resolve(null);
    for (const { stamps } of this.sections.values()) if (stamps !== null) this.reader?.detach(stamps);
    this.room.disconnect().catch(() => undefined); // it is gone already
  }

  private async join(): Promise<void> {
    const { url, token } = this.ticket;
    const iceServers = this.servers.map((server) => ({ ...server, urls: [...server.urls] }));
    const rtcConfig = iceServers.length > 0 ? { iceServers } : {};
    await this.room.connect(url, token, { autoSubscribe: false, maxRetries: 0, rtcConfig });
    for (const participant of this.room.remoteParticipants.values())
      for (const publication of participant.trackPublications.values())
        this.want(publication, participant.identity);
  }

  /**
   * Asked for one by one, a track is told of in the very moment it is there. What the client subscribes to by itself
   * is told of later, and a transform that comes after the first frame is passed by.
   */
  private want(publication: RemoteTrackPublication, identity: string): void {
    if (identity === this.ticket.publisher) publication.setSubscribed(true);
  }

  /** Its own transform, as for every peer: LiveKit's would take the trailer off and keep what it said. */
  private received(track: RemoteTrack, name: string): void {
    const videos = this.ticket.streams.filter((each) => each.kind === "video");
    const stream = videos.find((each) => each.stream === name);
    const { receiver } = track;
    if (stream === undefined || receiver === undefined || this.sections.has(stream.mid)) return;
    const stamps = this.reader?.attach(receiver, "video", true) ?? null;
    this.sections.set(stream.mid, receivedSection("video", receiver, stamps));
    if (videos.every((each) => this.sections.has(each.mid))) this.complete.resolve(null);
  }

  private heard(payload: Uint8Array, topic: string): void {
    if (topic === "feedback") {
      this.silence.heard();
      this.events.feedback(new TextDecoder().decode(payload));
    } else if (topic === "sound") {
      for (const { stream, time, data } of splitSounds(payload)) this.heardSound(stream, time, data);
    }
  }

  private heardSound(stream: number, time: number, data: Uint8Array): void {
    const stamps = this.sounds.get(stream);
    if (stamps === undefined) return;
    const { length, trailer } = splitTrailer(data);
    notePacket(stamps, time, markOfTrailer(trailer), false, data.slice(0, length).buffer);
  }

  private lose(why: string): void {
    if (this.isOver) return;
    this.complete.reject(new Error(why));
    this.close();
    this.events.lost(why);
  }
}
