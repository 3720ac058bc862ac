import { beforeEach, describe, expect, it } from "vitest";
import type { GateMode } from "../../src/gate/media_gate";
import { takeLag, type FrameMark, type GateContext } from "../../src/gate/gate_counters";
import {
  closePictureGate,
  createPictureGate,
  offerPicture,
  settlePicture,
  type PictureGate,
} from "../../src/gate/picture_gate";

class FakePicture {
  closed = 0;
  constructor(readonly rtp: number) {}
  close(): void {
    this.closed += 1;
  }
}

let gate: PictureGate<FakePicture>;
let stamps: Map<number, number | null>;
let drawn: [rtp: number, stamp: number | null, gap: number | null][];
let made: FakePicture[];

beforeEach(() => {
  gate = createPictureGate();
  stamps = new Map();
  drawn = [];
  made = [];
});

function contextOf(feedback: number | null, mode: GateMode = "event"): GateContext {
  return { feedback, tolerance: 4, gate: mode, wallMs: 10_000 };
}

/** Every picture was captured as many ms ago as its RTP timestamp says. */
function lookup(rtp: number): FrameMark | undefined {
  const stamp = stamps.get(rtp);
  return stamp === undefined ? undefined : { stamp, capturedMs: 10_000 - rtp };
}

function draw(picture: FakePicture, stamp: number | null, gap: number | null): void {
  expect(picture.closed).toBe(0);
  drawn.push([picture.rtp, stamp, gap]);
}

function offer(rtp: number, context: GateContext): void {
  const picture = new FakePicture(rtp);
  made.push(picture);
  offerPicture(gate, picture, rtp, lookup, context, draw);
}

describe("the picture gate", () => {
  it("draws a picture within tolerance and closes it", () => {
    stamps.set(90, 8);
    offer(90, contextOf(10));
    expect(drawn).toEqual([[90, 8, 2]]);
    expect(gate).toMatchObject({ shown: 8, kept: null });
    expect(gate.counts).toMatchObject({ rendered: 1, gap: 2, maxGap: 2, stamp: 8, violations: 0 });
    expect(made.map((picture) => picture.closed)).toEqual([1]);
  });

  it("discards and closes a picture that is too old", () => {
    stamps.set(90, 5);
    offer(90, contextOf(10));
    expect(drawn).toEqual([]);
    expect(gate.counts).toMatchObject({ discarded: 1, rendered: 0 });
    expect(made.map((picture) => picture.closed)).toEqual([1]);
  });

  it("keeps a picture that overtook the feedback until that catches up, and counts it once", () => {
    stamps.set(90, 15);
    offer(90, contextOf(10));
    settlePicture(gate, lookup, contextOf(10), draw);
    expect(gate.counts.held).toBe(1);
    settlePicture(gate, lookup, contextOf(11), draw);
    expect(drawn).toEqual([[90, 15, -4]]);
    expect(gate.counts).toMatchObject({ held: 1, rendered: 1, maxGap: 4 });
  });

  it("a held picture that a jump of the feedback left behind is discarded", () => {
    stamps.set(90, 15);
    offer(90, contextOf(10));
    settlePicture(gate, lookup, contextOf(30), draw);
    expect(drawn).toEqual([]);
    expect(gate.counts.discarded).toBe(1);
  });

  it("keeps only the newest of the held ones", () => {
    stamps.set(90, 15).set(91, 15);
    offer(90, contextOf(10));
    offer(91, contextOf(10));
    expect(made.map((picture) => picture.closed)).toEqual([1, 0]);
    settlePicture(gate, lookup, contextOf(15), draw);
    expect(drawn.map(([rtp]) => rtp)).toEqual([91]);
    expect(gate.counts).toMatchObject({ held: 2, discarded: 0 });
  });

  it("waits for the stamp, and never draws without one", () => {
    offer(90, contextOf(10));
    settlePicture(gate, lookup, contextOf(10), draw);
    expect(drawn).toEqual([]);
    stamps.set(90, 10);
    settlePicture(gate, lookup, contextOf(10), draw);
    expect(drawn).toEqual([[90, 10, 0]]);
  });

  it("discards a picture whose stamp never came, and one that has none", () => {
    offer(90, contextOf(10));
    stamps.set(91, null);
    offer(91, contextOf(10));
    expect(drawn).toEqual([]);
    expect(gate.counts.discarded).toBe(2);
  });

  it("holds pictures until the first feedback", () => {
    stamps.set(90, 1);
    offer(90, contextOf(null));
    expect(drawn).toEqual([]);
    settlePicture(gate, lookup, contextOf(1), draw);
    expect(drawn).toEqual([[90, 1, 0]]);
  });

  it("draws everything while it is off, and counts what is beyond the tolerance", () => {
    stamps.set(91, 2);
    offer(90, contextOf(100, "off"));
    offer(91, contextOf(100, "off"));
    expect(drawn).toEqual([
      [90, null, null],
      [91, 2, 98],
    ]);
    expect(gate.counts).toMatchObject({ received: 2, violations: 1, gapSum: 98, gapsKnown: 1 });
  });

  it("remembers the largest lag of all that came, drawn or not, until it is reported", () => {
    stamps.set(90, 10).set(91, 99);
    offer(90, contextOf(100));
    offer(91, contextOf(100));
    expect(takeLag(gate.counts)).toBe(90);
    expect(takeLag(gate.counts)).toBe(0);
  });

  it("closes the kept picture when it ends", () => {
    offer(90, contextOf(10));
    closePictureGate(gate);
    closePictureGate(gate);
    expect(made.map((picture) => picture.closed)).toEqual([1]);
  });

  it("settling without a picture does nothing", () => {
    settlePicture(gate, lookup, contextOf(10), draw);
    expect(drawn).toEqual([]);
  });
});
