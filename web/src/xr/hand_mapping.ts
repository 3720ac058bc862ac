import {
  about,
  difference,
  inverse,
  multiply,
  nearestRotationVector,
  ofRotationVector,
  rotate,
  rotationVector,
  type Quaternion,
  type RigidPose,
  type Vector,
} from "../util/rigid";

/** WebXR has x to the right, y up and -z ahead; a robot's base has x ahead, y to the left and z up (REP 103). */
const TO_REP_103: Quaternion = [0.5, -0.5, -0.5, 0.5];

/** The operator's settings for the motion of the hands. */
export interface HandSettings {
  readonly scale: number; // tool motion per hand motion: 0.5 halves it
  readonly view: number; // heading of the camera's look in the base's frame, rad; 0 ahead, to the left positive
  // What is held still, in the operator's words: x ahead and back, y left and right, z up and down.
  readonly locked: {
    readonly x: boolean;
    readonly y: boolean;
    readonly z: boolean;
    readonly rotation: boolean;
  };
}

export const DEFAULT_HAND: HandSettings = {
  scale: 1,
  view: 0,
  locked: { x: false, y: false, z: false, rotation: false },
};

/**
 * How a hand in the headset's space moves a tool in the base's frame: who faces along `forward` looks where the camera
 * looks, so that a hand that moves away from the operator moves the tool away in the picture.
 *
 * @param forward the operator's heading in the headset's space, rad (`heading`)
 */
export function baseFromSpace(forward: number, settings: HandSettings): Quaternion {
  const ahead = about([0, 1, 0], -forward);
  return multiply(about([0, 0, 1], settings.view), multiply(TO_REP_103, ahead));
}

/** WebXR's panel has x to the right, y up and z to who looks at it; its camera x to the right, y down, z ahead (REP 103). */
const TO_OPTICAL: Quaternion = [1, 0, 0, 0];

/**
 * How a hand in the headset's space moves a tool in the frame of a camera: as seen in the camera's picture.
 *
 * @param panel how the picture stands in the headset's space
 */
function cameraFromSpace(panel: Quaternion): Quaternion {
  return multiply(TO_OPTICAL, inverse(panel));
}

/** The frame of a tool's pose, as a hand sees it. */
export interface HandFrame {
  readonly turn: Quaternion; // from the headset's space to the frame
  readonly axes: readonly [ahead: number, left: number, up: number]; // which of its axes these are for the operator
}

export function baseFrame(forward: number, settings: HandSettings): HandFrame {
  return { turn: baseFromSpace(forward, settings), axes: [0, 1, 2] };
}

export function cameraFrame(panel: Quaternion): HandFrame {
  return { turn: cameraFromSpace(panel), axes: [2, 0, 1] };
}

/** A hand that is bound to a tool from one moment on. */
export interface HandBinding {
  readonly frame: HandFrame;
  readonly start: RigidPose; // of the hand, in the headset's space
  readonly tool: Quaternion; // at the start, in the pose's frame
  readonly settings: HandSettings;
  rotation: Vector; // the last one
}

/** `rotation`: the tool's goal at this moment, as a rotation vector in the pose's frame. */
export function bindHand(
  hand: RigidPose,
  rotation: Vector,
  frame: HandFrame,
  settings: HandSettings,
): HandBinding {
  return { frame, start: hand, tool: ofRotationVector(rotation), settings, rotation };
}

/**
 * The hand as six numbers for a clutch: how far it has moved since the binding (x, y, z in m, scaled), and the rotation
 * vector of the tool that has turned as the hand has. At the start they are 0, 0, 0 and the tool's own rotation.
 */
export function handValues(binding: HandBinding, hand: RigidPose): readonly number[] {
  const { frame, start, tool, settings } = binding;
  const { turn, axes } = frame;
  const { locked, scale } = settings;
  const way = rotate(turn, difference(hand.position, start.position)).map((part) => part * scale);
  for (const [at, name] of (["x", "y", "z"] as const).entries()) if (locked[name]) way[axes[at] ?? at] = 0;
  if (!locked.rotation) {
    const turned = multiply(hand.orientation, inverse(start.orientation)); // in the headset's space
    const inFrame = multiply(multiply(turn, turned), inverse(turn));
    binding.rotation = nearestRotationVector(rotationVector(multiply(inFrame, tool)), binding.rotation);
  }
  return [...way, ...binding.rotation];
}
