import { eventOfOffset } from "../../gate/capture_time";
import { UNMARKED, type FrameMark } from "../../gate/gate_counters";
import { createStampTable, findMark, noteMark } from "../../gate/stamp_table";

/** What Chromium tells of the frame that a receiver delivered last; not all of it is in TypeScript's library. */
export interface CapturedSource {
  readonly rtpTimestamp: number;
  readonly captureTimestamp?: number; // ms since 1900 on the sender's clock
  readonly senderCaptureTimeOffset?: number; // ms; carries the event reference
}

/** The part of RTCRtpReceiver that is read here. */
export interface SourceTeller {
  getSynchronizationSources(): readonly CapturedSource[];
}

const NTP_EPOCH_MS = 2_208_988_800_000; // from 1900 to 1970
const REMEMBERED = 16; // frames
const PATIENCE = 30; // pictures without a stamp, after which the browser is believed to tell none
const UNREADABLE = "lockstep.sources_tell_nothing";

/**
 * Stamps of a receiver's frames, read when they are decoded, from what the receiver says of its synchronization source.
 * Chromium hands each encoded picture to a transform with the next beat of a clock of 64 Hz, 8 ms later on average; a
 * receiver without a transform does not wait.
 */
export class SourceStamps {
  private readonly table = createStampTable(REMEMBERED);
  private silent = 0; // pictures without a stamp, until the first with one

  /** `unreadable`: called once when this browser tells no stamps, or the console sends none. */
  constructor(
    private readonly receiver: SourceTeller,
    private readonly unreadable: () => void,
  ) {}

  /** undefined: the receiver has delivered another frame since, so nothing is known of this one. */
  find(rtpTimestamp: number): FrameMark | undefined {
    const known = findMark(this.table, rtpTimestamp);
    if (known !== undefined) return known;
    const source = this.receiver
      .getSynchronizationSources()
      .find((each) => each.rtpTimestamp === rtpTimestamp);
    if (source === undefined) return undefined;
    const mark = markOf(source);
    noteMark(this.table, rtpTimestamp, mark);
    this.count(mark);
    return mark;
  }

  private count({ stamp }: FrameMark): void {
    if (stamp !== null) this.silent = -Infinity;
    else if (++this.silent === PATIENCE) this.unreadable();
  }
}

function markOf({ captureTimestamp, senderCaptureTimeOffset }: CapturedSource): FrameMark {
  const stamp = eventOfOffset(senderCaptureTimeOffset);
  if (stamp === null) return UNMARKED;
  return { stamp, capturedMs: captureTimestamp === undefined ? null : captureTimestamp - NTP_EPOCH_MS };
}

/** Whether sources may be asked: the browser's decoded pictures say their RTP timestamp, and no stamp was missed so far. */
export function sourcesTell(): boolean {
  const hasProcessor = "MediaStreamTrackProcessor" in globalThis && "VideoFrame" in globalThis;
  return hasProcessor && "metadata" in VideoFrame.prototype && !isNoted();
}

/** From now on this tab reads stamps by transforms. */
export function noteUnreadable(): void {
  try {
    sessionStorage.setItem(UNREADABLE, "1");
  } catch {
    // Without storage nothing is asked of sources at all.
  }
}

function isNoted(): boolean {
  try {
    return sessionStorage.getItem(UNREADABLE) !== null;
  } catch {
    return true;
  }
}
