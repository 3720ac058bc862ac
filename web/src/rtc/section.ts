import type { ReceiverStamps } from "./stamp_reader";

/** Sound that comes in packets and not over RTP. */
export interface PacketPlayer {
  /** Plays from now on, into what is returned. */
  connect(context: AudioContext): AudioNode;
}

/** One medium that is received, and the stamps of its frames. */
export interface Section {
  readonly kind: "audio" | "video";
  readonly source: MediaStreamTrack | PacketPlayer;
  readonly stamps: ReceiverStamps | null; // null where the browser has no transforms
  playing(): number | undefined; // RTP timestamp of the sound that plays now
}

/** What a browser receives over RTP. */
export function receivedSection(
  kind: "audio" | "video",
  receiver: RTCRtpReceiver,
  stamps: ReceiverStamps | null,
): Section {
  const playing = (): number | undefined => receiver.getSynchronizationSources()[0]?.rtpTimestamp;
  return { kind, source: receiver.track, stamps, playing };
}
