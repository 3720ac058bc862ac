import { UNMARKED, type FrameMark } from "../../gate/gate_counters";
import { findMark } from "../../gate/stamp_table";
import type { ReceiverStamps } from "../encoded_transform/stamp_reader";
import type { SourceStamps } from "./source_stamps";

/** One medium that is received, and the stamps of its frames. */
export interface MediaSection {
  readonly kind: "audio" | "video";
  readonly track: MediaStreamTrack; // sound: plays where the page plays no packets itself, as `stamps` tells
  readonly stamps: ReceiverStamps | null; // null without a transform
  mark(rtpTimestamp: number): FrameMark | undefined; // of a frame; undefined while nothing is known of it
  playing(): number | undefined; // RTP timestamp of the sound of `track` that plays now
}

/** What a browser receives over RTP; its frames are marked by a transform (`stamps`) or by `sources`. */
export function receivedSection(
  kind: "audio" | "video",
  receiver: RTCRtpReceiver,
  stamps: ReceiverStamps | null,
  sources: SourceStamps | null = null,
): MediaSection {
  const playing = (): number | undefined => receiver.getSynchronizationSources()[0]?.rtpTimestamp;
  const mark = (rtpTimestamp: number): FrameMark | undefined => {
    if (sources !== null) return sources.find(rtpTimestamp);
    return stamps === null ? UNMARKED : findMark(stamps.table, rtpTimestamp);
  };
  return { kind, track: receiver.track, stamps, mark, playing };
}
