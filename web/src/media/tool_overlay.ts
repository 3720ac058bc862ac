import { createScenePoses, forgetPoses, keepPose } from "../gate/scene_poses";
import type { Camera, Feedback, RobotDescription } from "../protocol/wire";
import { BodyPoses } from "../robot/body_poses";
import { toolFrames, type ToolState } from "../robot/tool_frames";
import { difference, inverse, rotate, type RigidPose, type Vector } from "../util/rigid";

type View = NonNullable<Camera["calibration"]>;
const KEY = "lockstep.tool_frames";

type Spot = readonly [x: number, y: number];

const LENGTH = 0.09; // of a frame's axis, for each metre that it is away
const NEAREST = 0.01; // m ahead of the camera
const AXES: readonly (readonly [axis: Vector, color: string])[] = [
  [[1, 0, 0], "#ff5a4d"],
  [[0, 1, 0], "#52d273"],
  [[0, 0, 1], "#5aa2ff"],
];
const EDGE = "rgba(8, 12, 16, 0.75)";
const GOAL = "#ffc24d";

/**
 * Draws the frames of the robot's tools into a picture, with the picture, on its own canvas: there is no moment at which
 * they belong to two events. Without the feedback of exactly the picture's event, or without the camera's place, it
 * draws nothing.
 */
export class ToolOverlay {
  private readonly poses = createScenePoses();
  private shown: RobotDescription | null = null; // the robot whose feedbacks are kept
  private hides = keptHidden(); // the person wants pictures without frames

  /** `description`: of the robot that is there now; null: none is. */
  constructor(private readonly description: () => RobotDescription | null) {}

  /** Whether the pictures have frames, where there are any: the person's own decision. */
  get isOn(): boolean {
    return !this.hides;
  }

  /** Shows or hides the frames, from the next picture on. The decision is kept. */
  toggle(): void {
    this.hides = !this.hides;
    try {
      localStorage.setItem(KEY, this.hides ? "hidden" : "shown");
    } catch {
      // storage is switched off: it holds until the page closes
    }
  }

  take(feedback: Feedback): void {
    if ((this.robot()?.poses.length ?? 0) > 0) keepPose(this.poses, feedback);
  }

  /** Draws into the picture of `stream` with the stamp `event`; null: it has none. */
  paint(context: CanvasRenderingContext2D, stream: string, event: number | null): void {
    const description = this.robot();
    if (description === null || event === null) return;
    const state = this.poses.kept.findLast((each) => each.event === event);
    if (state !== undefined) this.paintState(context, stream, description, state);
  }

  /** Draws into the picture of `stream` the frames of a robot in the state of exactly that picture's event. */
  paintState(
    context: CanvasRenderingContext2D,
    stream: string,
    description: RobotDescription,
    state: ToolState,
  ): void {
    if (this.hides || description.poses.length === 0) return;
    const camera = description.cameras.find(({ name }) => name === stream);
    const view = camera?.calibration ?? null;
    if (camera === undefined || view === null || isDistorted(view)) return;
    if (description.joints.some(({ name }) => state.unknown.includes(name))) return; // the camera may be on one
    const place = new BodyPoses(description, state.joints).ofCamera(camera);
    if (place === null) return;
    const { width, height } = context.canvas;
    context.save();
    context.scale(width / camera.width, height / camera.height); // the console may send it smaller
    context.lineWidth = 2.5 * (camera.width / 640);
    context.lineCap = "round";
    for (const { measured, goal } of toolFrames(description, state)) {
      if (goal !== null && measured !== null) this.lead(context, view, place, measured, goal);
      if (measured !== null) drawFrame(context, view, place, measured);
      if (goal !== null) drawFrame(context, view, place, goal, true);
    }
    context.restore();
  }

  /** The robot that is there now. The events of another one, or of another bridge, begin anew. */
  private robot(): RobotDescription | null {
    const description = this.description();
    if (description !== this.shown) forgetPoses(this.poses);
    return (this.shown = description);
  }

  /** From the tool to its goal. */
  private lead(
    context: CanvasRenderingContext2D,
    view: View,
    place: RigidPose,
    measured: RigidPose,
    goal: RigidPose,
  ): void {
    const from = spotOf(view, inCamera(place, measured.position));
    const to = spotOf(view, inCamera(place, goal.position));
    if (from !== null && to !== null) line(context, from, to, GOAL, [2, 6]);
  }
}

function keptHidden(): boolean {
  try {
    return localStorage.getItem(KEY) === "hidden";
  } catch {
    return false;
  }
}

/** Lenses that bend lines: a pinhole would say where nothing is. */
function isDistorted({ distortion }: View): boolean {
  return distortion.some((each) => each !== 0);
}

function drawFrame(
  context: CanvasRenderingContext2D,
  view: View,
  place: RigidPose,
  frame: RigidPose,
  isGoal = false,
): void {
  const origin = inCamera(place, frame.position);
  const middle = spotOf(view, origin);
  if (middle === null) return;
  const length = LENGTH * origin[2];
  for (const [axis, color] of AXES) {
    const [x, y, z] = rotate(frame.orientation, axis);
    const [ox, oy, oz] = frame.position;
    const end = spotOf(view, inCamera(place, [ox + length * x, oy + length * y, oz + length * z]));
    if (end !== null) line(context, middle, end, color, isGoal ? [5, 4] : []);
  }
  if (!isGoal) return;
  context.beginPath();
  context.arc(...middle, 2.5 * context.lineWidth, 0, 2 * Math.PI);
  context.strokeStyle = GOAL;
  context.stroke();
}

function line(
  context: CanvasRenderingContext2D,
  from: Spot,
  to: Spot,
  color: string,
  dash: readonly number[],
): void {
  const { lineWidth } = context;
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.setLineDash([]);
  if (dash.length === 0) {
    context.lineWidth = 2 * lineWidth;
    context.strokeStyle = EDGE;
    context.stroke();
  }
  context.lineWidth = lineWidth;
  context.setLineDash([...dash]);
  context.strokeStyle = color;
  context.stroke();
  context.setLineDash([]);
}

/** A point of the robot's world in the camera's frame. */
export function inCamera(place: RigidPose, point: Vector): Vector {
  return rotate(inverse(place.orientation), difference(point, place.position));
}

/** Where a point in the camera's frame is in its picture, pixels; null: not ahead of the camera. */
export function spotOf({ fx, fy, cx, cy }: View, [x, y, z]: Vector): Spot | null {
  return z < NEAREST ? null : [cx + (fx * x) / z, cy + (fy * y) / z];
}
