import type { Feedback, Pose, RobotDescription } from "../protocol/wire";
import { distance, inverse, multiply, ofRotationVector, type RigidPose, type Vector } from "../util/rigid";
import { BodyPoses, joined } from "./body_poses";

/** What the frames of tools are made of. */
export type ToolState = Pick<Feedback, "joints" | "goals" | "unknown">;

/** The frames of one tool in the robot's world. */
export interface ToolFrames {
  readonly label: string;
  readonly measured: RigidPose | null; // null: not all joints were measured
  readonly goal: RigidPose | null; // null: not known, or as good as reached
}

const SAME_PLACE = 0.003; // m
const SAME_TURN = Math.cos(0.02); // of half the angle

/** Where the tools of the robot's poses are, and where they are to be. */
export function toolFrames(description: RobotDescription, state: ToolState): ToolFrames[] {
  const poses = new BodyPoses(description, state.joints);
  const unknown = new Set(state.unknown);
  const isKnown = description.joints.every(({ name }) => !unknown.has(name));
  return description.poses.map((pose) => {
    const body = isKnown ? poses.of(pose.body) : null;
    const measured = body === null ? null : joined(body, { position: pose.point, orientation: [0, 0, 0, 1] });
    const goal = isKnown ? goalOf(description, pose, state.goals, poses, measured) : null;
    return {
      label: pose.label,
      measured,
      goal: goal !== null && measured !== null && isSame(goal, measured) ? null : goal,
    };
  });
}

/** What the pose's axes do not say is as it was measured. */
function goalOf(
  description: RobotDescription,
  pose: Pose,
  goals: Feedback["goals"],
  poses: BodyPoses,
  measured: RigidPose | null,
): RigidPose | null {
  const valueOf = (name: string): number | null =>
    goals[description.axes.findIndex((axis) => axis.name === name)] ?? null;
  const position = vectorOf(pose.position.map(valueOf));
  const frame = frameOf(description, pose, poses);
  if (position === null || frame === null) return null;
  const rotation = vectorOf(pose.rotation.map(valueOf));
  if (rotation !== null) return joined(frame, { position, orientation: ofRotationVector(rotation) });
  if (measured === null) return null;
  return { ...joined(frame, { position, orientation: [0, 0, 0, 1] }), orientation: measured.orientation };
}

function frameOf(description: RobotDescription, { frame }: Pose, poses: BodyPoses): RigidPose | null {
  const body = poses.of(frame);
  if (body !== null) return body;
  const camera = description.cameras.find(({ name }) => name === frame);
  return camera === undefined ? null : poses.ofCamera(camera);
}

function vectorOf([x, y, z]: readonly (number | null | undefined)[]): Vector | null {
  return typeof x === "number" && typeof y === "number" && typeof z === "number" ? [x, y, z] : null;
}

function isSame(one: RigidPose, other: RigidPose): boolean {
  const turn = multiply(inverse(one.orientation), other.orientation);
  return distance(one.position, other.position) < SAME_PLACE && Math.abs(turn[3]) > SAME_TURN;
}
