import { eventGap } from "../gate/serial";
import { addSample, createSamples, type Samples } from "../util/samples";

const PENDING_LIMIT = 256;

/** Delays measured on this page's own clock, from the first send of each event. */
export interface Latency {
  readonly toFeedback: Samples; // ms
  readonly toPicture: Samples; // ms: until the first picture stamped with the event or a later one is shown
  pictureMs: number | null; // the newest of `toPicture`
  pictureAtMs: number; // when that was measured
  readonly awaitingFeedback: Map<number, number>; // event -> when it was first sent
  readonly awaitingPicture: Map<number, number>;
}

export function createLatency(): Latency {
  return {
    toFeedback: createSamples(500),
    toPicture: createSamples(500),
    pictureMs: null,
    pictureAtMs: -Infinity,
    awaitingFeedback: new Map(),
    awaitingPicture: new Map(),
  };
}

export function noteCommandSent(latency: Latency, event: number, now: number): void {
  for (const pending of [latency.awaitingFeedback, latency.awaitingPicture]) {
    if (!pending.has(event)) pending.set(event, now);
    for (const oldest of pending.keys()) {
      if (pending.size <= PENDING_LIMIT) break;
      pending.delete(oldest);
    }
  }
}

/** Forgets a refused event: what is sent under its number later is measured anew. */
export function noteCommandRefused(latency: Latency, event: number): void {
  latency.awaitingFeedback.delete(event);
  latency.awaitingPicture.delete(event);
}

/** The time from the send of the answered event, null when it was not sent from here. */
export function noteFeedback(latency: Latency, event: number, now: number): number | null {
  const sent = latency.awaitingFeedback.get(event);
  dropUpTo(latency.awaitingFeedback, event);
  if (sent === undefined) return null;
  addSample(latency.toFeedback, now - sent);
  return now - sent;
}

export function notePicture(latency: Latency, stamp: number, now: number): void {
  for (const sent of dropUpTo(latency.awaitingPicture, stamp)) {
    latency.pictureMs = now - sent;
    latency.pictureAtMs = now;
    addSample(latency.toPicture, latency.pictureMs);
  }
}

function dropUpTo(pending: Map<number, number>, event: number): number[] {
  const dropped: number[] = [];
  for (const [sent, at] of pending) {
    if (eventGap(event, sent) < 0) continue;
    pending.delete(sent);
    dropped.push(at);
  }
  return dropped;
}
