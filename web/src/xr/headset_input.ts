import type { PadInputs } from "../gamepad/mapping";
import { shapeStick } from "../gamepad/stick_shape";
import { distance, inverse, multiply, rotationVector, type RigidPose } from "../util/rigid";

export type Side = "left" | "right";

/** One controller or hand at one frame of the session. */
export interface HandSample {
  readonly side: Side;
  readonly pose: RigidPose | null; // null: not tracked, or only guessed by the headset
  readonly squeeze: number; // 0 to 1
  readonly trigger: number; // 0 to 1; the pinch of a hand
  readonly stick: readonly [x: number, y: number]; // as a gamepad has it: right and down are positive
  readonly stop: boolean; // the upper button
  readonly layer: boolean; // the lower button
  readonly recentre: boolean; // the stick is pressed
}

/** The actions for the shell, in this order. */
export type HeadsetEvent =
  | { readonly kind: "arm"; readonly side: Side } // and `grab` if that succeeded
  | { readonly kind: "lost"; readonly why: "squeeze_released" | "tracking_lost" }
  | { readonly kind: "press"; readonly side: Side; readonly drives: boolean } // of the trigger
  | { readonly kind: "layer" | "recentre" | "stop" };

interface HandState {
  squeezed: boolean;
  pressed: boolean; // the trigger
  stop: boolean;
  layer: boolean;
  recentre: boolean;
  pose: RigidPose | null;
}

/** The state of the inputs in the headset's session. */
export interface HeadsetInput {
  readonly hands: Map<Side, HandState>;
  readonly held: Set<Side>; // hands whose squeeze lets the robot move; empty: it may not
  inputs: PadInputs;
  frameMs: number; // when the newest frame came
}

/** A session's frames come every 8 to 16 ms. Without one for this long, nobody knows what is held. */
export const SILENT_MS = 300;
const SQUEEZED = 0.6;
const RELEASED = 0.35;
const FASTEST = 8; // m/s; a hand that is faster has jumped: the headset found it somewhere else
const QUICKEST = 40; // rad/s, the same for its turning: a flicked wrist reaches some 25
const WIDEST = 2.5; // rad, that a wrist turns between two frames at most, however far these are apart

const NOTHING: PadInputs = {
  left_x: 0,
  left_y: 0,
  right_x: 0,
  right_y: 0,
  dpad_x: 0,
  dpad_y: 0,
  triggers: 0,
};

export function createHeadsetInput(): HeadsetInput {
  return { hands: new Map(), held: new Set(), inputs: NOTHING, frameMs: -Infinity };
}

/** The hand of this side holds the deadman until it lets go, or is lost. */
export function grab(input: HeadsetInput, side: Side): void {
  input.held.add(side);
}

/** Nothing is held any more: each hand has to let go and squeeze again. */
export function letGo(input: HeadsetInput): void {
  input.held.clear();
}

/** Whether no frame has told for so long that what is held is not known. */
export function isSilent(input: HeadsetInput, now: number): boolean {
  return now - input.frameMs > SILENT_MS;
}

/**
 * Takes what one frame of the session says. A squeeze counts only if the hand was seen open before. A hand that holds
 * the deadman and is not tracked any more, or comes out elsewhere, is lost: what it does is not known.
 */
export function takeFrame(input: HeadsetInput, samples: readonly HandSample[], now: number): HeadsetEvent[] {
  const events: HeadsetEvent[] = [];
  const elapsed = now - input.frameMs;
  const held = new Set(input.held); // what one hand lets go now, the other held when it pressed
  input.frameMs = now;
  for (const side of [...input.hands.keys()])
    if (!samples.some((sample) => sample.side === side)) lose(input, side, events);
  for (const sample of samples) takeHand(input, sample, held, elapsed, events);
  input.inputs = inputsOf(samples);
  return events;
}

function takeHand(
  input: HeadsetInput,
  sample: HandSample,
  held: ReadonlySet<Side>, // before this frame
  elapsed: number,
  events: HeadsetEvent[],
): void {
  const { side, pose } = sample;
  const before = input.hands.get(side);
  const state: HandState = {
    squeezed: isPressed(sample.squeeze, before?.squeezed ?? false),
    pressed: isPressed(sample.trigger, before?.pressed ?? false),
    stop: sample.stop,
    layer: sample.layer,
    recentre: sample.recentre,
    pose,
  };
  input.hands.set(side, state);
  if (before === undefined) {
    // What it holds when it comes is no new press, but of STOP: it may have been pressed while the hand was lost.
    if (state.stop) events.push({ kind: "stop" });
    return;
  }
  for (const kind of ["stop", "layer", "recentre"] as const)
    if (state[kind] && !before[kind]) events.push({ kind });
  const asks = state.squeezed && !before.squeezed;
  const drives = held.has(side) || asks;
  if (state.pressed && !before.pressed) events.push({ kind: "press", side, drives });
  if (input.held.has(side)) {
    if (pose === null || hasJumped(before.pose, pose, elapsed)) drop(input, side, "tracking_lost", events);
    else if (!state.squeezed) drop(input, side, "squeeze_released", events);
  } else if (asks && pose !== null) events.push({ kind: "arm", side });
}

function lose(input: HeadsetInput, side: Side, events: HeadsetEvent[]): void {
  input.hands.delete(side);
  if (input.held.has(side)) drop(input, side, "tracking_lost", events);
}

/** One hand that is lost ends driving with both; one that lets go leaves the other to go on. */
function drop(
  input: HeadsetInput,
  side: Side,
  why: "squeeze_released" | "tracking_lost",
  events: HeadsetEvent[],
): void {
  input.held.delete(side);
  if (why === "tracking_lost") input.held.clear();
  if (input.held.size === 0) events.push({ kind: "lost", why });
}

function hasJumped(before: RigidPose | null, pose: RigidPose, elapsed: number): boolean {
  if (before === null) return false;
  const seconds = Math.max(elapsed, 10) / 1000;
  const turn = rotationVector(multiply(pose.orientation, inverse(before.orientation)));
  return (
    distance(before.position, pose.position) > FASTEST * seconds ||
    Math.hypot(...turn) > Math.min(QUICKEST * seconds, WIDEST)
  );
}

function isPressed(value: number, before: boolean): boolean {
  return value >= (before ? RELEASED : SQUEEZED);
}

/** The controllers as the two halves of a gamepad. */
function inputsOf(samples: readonly HandSample[]): PadInputs {
  const of = (side: Side): HandSample | undefined => samples.find((sample) => sample.side === side);
  const [left, right] = [of("left"), of("right")];
  return {
    ...NOTHING,
    left_x: shapeStick(left?.stick[0] ?? 0),
    left_y: shapeStick(left?.stick[1] ?? 0),
    right_x: shapeStick(right?.stick[0] ?? 0),
    right_y: shapeStick(right?.stick[1] ?? 0),
    triggers: shapeStick((right?.trigger ?? 0) - (left?.trigger ?? 0)),
  };
}
