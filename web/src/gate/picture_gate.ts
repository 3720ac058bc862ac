import { judge } from "./media_gate";
import {
  UNMARKED,
  ageOf,
  createGateCounters,
  noteRendered,
  noteSeen,
  type FrameMark,
  type GateContext,
  type GateCounters,
} from "./gate_counters";

/** A picture in memory; whoever keeps it last closes it. */
export interface Closable {
  close(): void;
}

interface Kept<P extends Closable> {
  readonly picture: P;
  readonly rtpTimestamp: number;
  counted: boolean; // as held
}

/** The gate of one video stream. Keeps at most one picture: the newest, until its stamp or the feedback arrives. */
export interface PictureGate<P extends Closable> {
  readonly counts: GateCounters;
  kept: Kept<P> | null;
  shown: number | null; // stamp of the picture on screen
}

/** `undefined`: nothing known yet. */
export type MarkLookup = (rtpTimestamp: number) => FrameMark | undefined;
export type Draw<P> = (picture: P, stamp: number | null, gap: number | null, ageMs: number | null) => void;

export function createPictureGate<P extends Closable>(): PictureGate<P> {
  return { counts: createGateCounters(), kept: null, shown: null };
}

/** Takes the newest picture, then settles it as far as it can be. */
export function offerPicture<P extends Closable>(
  gate: PictureGate<P>,
  picture: P,
  rtpTimestamp: number,
  lookup: MarkLookup,
  context: GateContext,
  draw: Draw<P>,
): void {
  dropKept(gate);
  gate.counts.received += 1;
  gate.kept = { picture, rtpTimestamp, counted: false };
  settlePicture(gate, lookup, context, draw);
}

/** Judges the kept picture again: after a feedback, a stamp, or a change of the settings. */
export function settlePicture<P extends Closable>(
  gate: PictureGate<P>,
  lookup: MarkLookup,
  context: GateContext,
  draw: Draw<P>,
): void {
  const { kept, counts } = gate;
  if (kept === null) return;
  const found = lookup(kept.rtpTimestamp);
  if (found === undefined && context.gate !== "off") return;
  const mark = found ?? UNMARKED;
  const { stamp } = mark;
  if (stamp !== null) counts.stamp = stamp;
  const { verdict, gap } = judge(context.feedback, stamp, context.tolerance, context.gate);
  noteSeen(counts, gap);
  if (verdict === "hold") {
    if (!kept.counted) counts.held += 1;
    kept.counted = true;
    return;
  }
  gate.kept = null;
  if (verdict === "render") {
    draw(kept.picture, stamp, gap, ageOf(mark, context));
    gate.shown = stamp;
    noteRendered(counts, gap, context);
  } else counts.discarded += 1;
  kept.picture.close();
}

export function closePictureGate<P extends Closable>(gate: PictureGate<P>): void {
  gate.kept?.picture.close();
  gate.kept = null;
}

/** A newer picture replaces the kept one. One that never got its stamp was discarded; a held one is counted already. */
function dropKept<P extends Closable>(gate: PictureGate<P>): void {
  if (gate.kept === null) return;
  if (!gate.kept.counted) gate.counts.discarded += 1;
  closePictureGate(gate);
}
