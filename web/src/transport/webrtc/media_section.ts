import type { ReceiverStamps } from "../encoded_transform/stamp_reader";

/** One medium that is received, and the stamps of its frames. */
export interface MediaSection {
  readonly kind: "audio" | "video";
  readonly track: MediaStreamTrack | null; // null: sound whose packets come to the page, as `stamps` tells
  readonly stamps: ReceiverStamps | null; // null where the browser has no transforms
  playing(): number | undefined; // RTP timestamp of the sound of `track` that plays now
}

/** What a browser receives over RTP. */
export function receivedSection(
  kind: "audio" | "video",
  receiver: RTCRtpReceiver,
  stamps: ReceiverStamps | null,
): MediaSection {
  const playing = (): number | undefined => receiver.getSynchronizationSources()[0]?.rtpTimestamp;
  return { kind, track: stamps?.packets === true ? null : receiver.track, stamps, playing };
}
