import { isRecord } from "../protocol/schema_check";
import { eventGap, isEvent } from "./serial";
import type { GateContext } from "./gate_counters";
import { eventsBehind } from "./gap_label";

/** A part of the 3D scene's stream that waits for its event. */
interface HeldUpdate {
  readonly event: number;
  readonly deliver: Deliver;
}

/** Lets an update through; null: it builds the scene and belongs to no event. `confirmShown` follows. */
type Deliver = (event: number | null) => void;

/**
 * Keeps the 3D scene at the event of the picture on screen. Updates of the scene say how it changed, so none may be
 * left out: they wait in order.
 */
export interface SceneGate {
  readonly held: HeldUpdate[];
  tagged: number | null; // event of the newest update that came
  shown: number | null; // event that the scene says it shows; null before it shows one
  forced: number; // updates that could wait no longer: then the veil says what the scene shows
}

/** At 15 updates a second more than ten seconds. */
const MAX_HELD = 200;

export function createSceneGate(): SceneGate {
  return { held: [], tagged: null, shown: null, forced: 0 };
}

/** A new stream begins: what waited belongs to the old one. */
export function resetSceneGate(gate: SceneGate): void {
  gate.held.length = 0;
  gate.tagged = null;
  gate.shown = null;
}

/** Takes an update. One that names no event belongs to the event before it; those before any event build the scene. */
export function offerUpdate(
  gate: SceneGate,
  event: number | null,
  due: number | "all" | null,
  deliver: Deliver,
): void {
  gate.tagged = event ?? gate.tagged;
  if (gate.tagged === null) {
    deliver(null);
    return;
  }
  gate.held.push({ event: gate.tagged, deliver });
  settleScene(gate, due);
  while (gate.held.length > MAX_HELD) {
    gate.forced += 1;
    deliverFirst(gate);
  }
}

/** Delivers what is due: everything up to this event; null while nothing is known. */
export function settleScene(gate: SceneGate, due: number | "all" | null): void {
  const isDue = (event: number): boolean => due === "all" || (due !== null && eventGap(due, event) >= 0);
  for (let first = gate.held[0]; first !== undefined && isDue(first.event); first = gate.held[0])
    deliverFirst(gate);
}

/**
 * The newest event that the scene may show: that of the picture on screen while it is within tolerance. Where no such
 * picture is, the feedback's own.
 */
export function sceneDue(context: GateContext, picture: number | null): number | "all" | null {
  const { feedback, tolerance, gate } = context;
  if (gate !== "event") return "all";
  if (feedback === null || picture === null) return feedback;
  return Math.abs(eventGap(feedback, picture)) <= tolerance ? picture : feedback;
}

/** Why the scene must not be trusted; null when it may. `age`: of the feedback, once that is too old; null before. */
export function sceneStaleness(
  gate: Pick<SceneGate, "shown">,
  context: GateContext,
  age: string | null,
): string | null {
  if (gate.shown === null) return "Waiting for the robot's state";
  if (age !== null) return `No feedback for ${age}`;
  if (context.gate !== "event" || context.feedback === null) return null;
  const gap = eventGap(context.feedback, gate.shown);
  if (Math.abs(gap) <= context.tolerance) return null;
  return gap > 0 ? eventsBehind(gap) : "Ahead of the robot's feedback";
}

/** The event that a batch of the scene's messages belongs to: the label in the scene that says "s 12"; null without it. */
export function eventOfBatch(messages: unknown): number | null {
  if (!Array.isArray(messages)) return null;
  let found: number | null = null;
  for (const message of messages as unknown[]) {
    const event = eventOfMessage(message);
    if (event !== null) found = event;
  }
  return found;
}

function eventOfMessage(message: unknown): number | null {
  if (!isRecord(message) || message["type"] !== "SceneNodeUpdateMessage") return null;
  const { name, updates } = message;
  if (typeof name !== "string" || !name.endsWith("/event") || !isRecord(updates)) return null;
  const { text } = updates;
  const match = typeof text === "string" ? /^s (\d{1,10})/.exec(text) : null;
  const event = Number(match?.[1]);
  return isEvent(event) ? event : null;
}

function deliverFirst(gate: SceneGate): void {
  const first = gate.held.shift();
  if (first === undefined) return;
  first.deliver(first.event);
}

/** The scene shows what was let through. */
export function confirmShown(gate: SceneGate, event: number | null): void {
  if (event !== null) gate.shown = event;
}
