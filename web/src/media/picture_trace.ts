import { BoundedLog } from "../util/bounded_log";
import { setSpan } from "../util/span_values";
import type { PictureSpans } from "../protocol/wire";
import type { TransformTimes } from "../transport/encoded_transform/stamp_messages";

/** A picture that was drawn, with the spans that this page has measured. */
export interface DrawnPicture {
  readonly rtpTimestamp: number;
  readonly stamp: number | null;
  readonly drawnMs: number; // performance.now()
  readonly spans: PictureSpans;
}

const WAITING = 64; // pictures between transform and canvas

/**
 * Where the pictures of one camera spend their time on this page. Whatever decodes them calls `transformed` for each
 * encoded picture, `decoded` when the gate is offered one, and `drawn` when the gate has let that one pass. A point that
 * is left out leaves its span out.
 */
export class PictureTrace {
  readonly log = new BoundedLog<DrawnPicture>(256);
  private readonly transforms = new Map<number, TransformTimes>();
  private offered: { readonly rtpTimestamp: number; readonly atMs: number } | null = null;

  transformed(rtpTimestamp: number, times: TransformTimes): void {
    this.transforms.set(rtpTimestamp, times);
    for (const oldest of this.transforms.keys()) {
      if (this.transforms.size <= WAITING) break;
      this.transforms.delete(oldest);
    }
  }

  /** `atMs`: performance.now() of the page. The gate keeps the newest picture only, and so does this. */
  decoded(rtpTimestamp: number, atMs: number): void {
    this.offered = { rtpTimestamp, atMs };
  }

  /** The picture that was offered last passed the gate at `beganMs` and is on the canvas at `drawnMs`. */
  drawn(stamp: number | null, beganMs: number, drawnMs: number): DrawnPicture | null {
    const { offered } = this;
    if (offered === null) return null;
    this.offered = null;
    const { rtpTimestamp, atMs } = offered;
    const times = this.transforms.get(rtpTimestamp);
    const spans: { -readonly [name in keyof PictureSpans]: PictureSpans[name] } = {};
    if (times !== undefined) {
      if (times.receivedMs !== null) setSpan(spans, "assemble_ms", times.enteredMs - times.receivedMs);
      setSpan(spans, "transform_ms", times.leftMs - times.enteredMs);
      setSpan(spans, "decode_ms", performance.timeOrigin + atMs - times.leftMs);
    }
    setSpan(spans, "gate_ms", beganMs - atMs);
    setSpan(spans, "draw_ms", drawnMs - beganMs);
    const picture: DrawnPicture = { rtpTimestamp, stamp, drawnMs, spans };
    this.log.add(picture);
    return picture;
  }
}
