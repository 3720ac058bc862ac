import { readGesture } from "../xr/hand_gesture";
import type { HandSample, Side } from "../xr/headset_input";
import type { Quaternion, RigidPose, Vector } from "../util/rigid";

/** One controller or hand at one frame, with what only the view needs. */
export interface HandReading {
  readonly sample: HandSample;
  readonly ray: RigidPose | null; // it points along its -z
  readonly gamepad: Gamepad | null;
  readonly isHand: boolean; // without a controller
}

/** Buttons of WebXR's "xr-standard" mapping. */
const TRIGGER = 0;
const SQUEEZE = 1;
const STICK = 3;
const LOWER = 4; // A, X
const UPPER = 5; // B, Y
const STICK_X = 2; // axes
const STICK_Y = 3;

/** The readings of the session's input sources in this frame; of two on one side the controller counts. */
export function readHands(
  frame: XRFrame,
  space: XRReferenceSpace,
  sources: Iterable<XRInputSource>,
): HandReading[] {
  const found = new Map<Side, HandReading>();
  for (const source of sources) {
    if (source.targetRayMode !== "tracked-pointer") continue;
    const side: Side = source.handedness === "left" ? "left" : "right";
    const known = found.get(side);
    if (known !== undefined && !known.isHand) continue;
    found.set(side, readSource(frame, space, source, side));
  }
  return [...found.values()];
}

/** null: not tracked, or its place is only guessed. */
export function trackedPose(pose: XRPose | null | undefined): RigidPose | null {
  if (pose === null || pose === undefined || pose.emulatedPosition) return null;
  const { position, orientation } = pose.transform;
  const place: Vector = [position.x, position.y, position.z];
  const turn: Quaternion = [orientation.x, orientation.y, orientation.z, orientation.w];
  return [...place, ...turn].every(Number.isFinite) ? { position: place, orientation: turn } : null;
}

function readSource(frame: XRFrame, space: XRReferenceSpace, source: XRInputSource, side: Side): HandReading {
  const hand = source.hand ?? null;
  const grip = source.gripSpace ?? hand?.get("wrist") ?? source.targetRaySpace;
  const pose = trackedPose(frame.getPose(grip, space));
  const ray = trackedPose(frame.getPose(source.targetRaySpace, space));
  const gamepad = source.gamepad ?? null;
  const sample =
    hand === null ? controllerSample(side, pose, gamepad) : handSample(side, pose, frame, space, hand);
  return { sample, ray, gamepad, isHand: hand !== null };
}

function controllerSample(side: Side, pose: RigidPose | null, gamepad: Gamepad | null): HandSample {
  const value = (button: number): number => {
    const found = gamepad?.buttons[button];
    return found === undefined ? 0 : found.pressed && found.value === 0 ? 1 : found.value;
  };
  const isDown = (button: number): boolean => gamepad?.buttons[button]?.pressed === true;
  const hasUpper = (gamepad?.buttons.length ?? 0) > UPPER;
  return {
    side,
    pose,
    squeeze: value(SQUEEZE),
    trigger: value(TRIGGER),
    stick: [gamepad?.axes[STICK_X] ?? 0, gamepad?.axes[STICK_Y] ?? 0],
    stop: isDown(hasUpper ? UPPER : LOWER),
    layer: hasUpper && isDown(LOWER),
    recentre: isDown(STICK),
  };
}

function handSample(
  side: Side,
  pose: RigidPose | null,
  frame: XRFrame,
  space: XRReferenceSpace,
  hand: XRHand,
): HandSample {
  const gesture = readGesture((name) => {
    const joint = hand.get(name as XRHandJoint);
    const found = joint === undefined ? undefined : frame.getJointPose?.(joint, space);
    return trackedPose(found)?.position ?? null;
  });
  return {
    side,
    pose: gesture === null ? null : pose,
    squeeze: gesture?.squeeze ?? 0,
    trigger: gesture?.pinch ?? 0,
    stick: [0, 0],
    stop: false,
    layer: false,
    recentre: false,
  };
}
