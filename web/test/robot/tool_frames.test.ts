import { describe, expect, it } from "vitest";
import vectors from "../../../tests/vectors/poses.json";
import { BodyPoses } from "../../src/robot/body_poses";
import { toolFrames } from "../../src/robot/tool_frames";
import { about, type RigidPose } from "../../src/util/rigid";
import type { Body, Camera, Pose, RobotDescription } from "../../src/protocol/wire";
import { descriptionOf, goalAxisOf } from "../messages";

const NAMES = ["x", "y", "z", "rx", "ry", "rz"] as const;
const POSE: Pose = {
  ...{
    name: "tool",
    label: "Tool",
    body: "hand",
    frame: "",
    point: [0, 0, 0.1],
    instead_of: [],
    settling: 0,
  },
  ...{ position: ["x", "y", "z"], rotation: ["rx", "ry", "rz"] },
};
const HAND: Body = {
  ...{ name: "hand", parent: "", position: [1, 0, 0], orientation: [1, 0, 0, 0], geoms: [] },
  joints: [{ joint: "turn", kind: "revolute", axis: [0, 1, 0] }],
};
const CAMERA: Camera = {
  ...{
    name: "front",
    label: "Front",
    width: 640,
    height: 480,
    frame_rate: 30,
    metres_per_pixel: null,
    click: "",
  },
  calibration: {
    body: "",
    position: [0, 0, 2],
    orientation: [1, 0, 0, 0],
    fx: 500,
    fy: 500,
    cx: 320,
    cy: 240,
    distortion_model: "",
    distortion: [],
  },
};

function robot(pose: Partial<Pose> = {}): RobotDescription {
  return {
    ...descriptionOf(NAMES.map((name) => goalAxisOf(name))),
    joints: [{ name: "turn", unit: "rad", minimum: null, maximum: null }],
    bodies: [HAND],
    cameras: [CAMERA],
    poses: [{ ...POSE, ...pose }],
  };
}

function expectPose(
  found: RigidPose | null | undefined,
  position: readonly number[],
  turn: readonly number[],
): void {
  expect(found).not.toBeNull();
  for (const [at, value] of position.entries()) expect(found?.position[at]).toBeCloseTo(value, 6);
  const sign = Math.sign((found?.orientation[3] ?? 1) * (turn[3] ?? 1)) || 1;
  for (const [at, value] of turn.entries())
    expect(sign * (found?.orientation[at] ?? 0)).toBeCloseTo(value, 6);
}

it("bodies are where the console's own kinematics has them", () => {
  const description = {
    ...descriptionOf([]),
    joints: vectors.joints.map((name) => ({ name, unit: "rad" as const, minimum: null, maximum: null })),
    bodies: vectors.bodies as unknown as Body[],
  };
  for (const { joints, positions } of vectors.cases) {
    const poses = new BodyPoses(description, joints);
    for (const [name, place] of Object.entries(positions))
      for (const [at, value] of place.entries()) expect(poses.of(name)?.position[at]).toBeCloseTo(value, 4);
  }
});

it("a body that is not there, or hangs on itself, is nowhere", () => {
  const loop = { ...HAND, parent: "hand" };
  expect(new BodyPoses(robot(), [0]).of("foot")).toBeNull();
  expect(new BodyPoses({ ...robot(), bodies: [loop] }, [0]).of("hand")).toBeNull();
});

describe("the frames of a tool", () => {
  const quarter = about([0, 1, 0], Math.PI / 2);

  it("are where its joints were measured, and where its goals are", () => {
    const [found] = toolFrames(robot(), {
      joints: [Math.PI / 2],
      goals: [0.5, 0.1, 0.2, 0, 0, Math.PI / 2],
      unknown: [],
    });
    expectPose(found?.measured, [1.1, 0, 0], quarter);
    expectPose(found?.goal, [0.5, 0.1, 0.2], about([0, 0, 1], Math.PI / 2));
  });

  it("have no goal that is as good as reached, and none that is not known", () => {
    const at = (goals: readonly (number | null)[]) =>
      toolFrames(robot(), { joints: [Math.PI / 2], goals, unknown: [] })[0];
    expect(at([1.101, 0, 0, 0, Math.PI / 2, 0])?.goal).toBeNull();
    expect(at([])?.goal).toBeNull();
    expect(at([1, null, 0, 0, 0, 0])?.goal).toBeNull();
    expect(at([])?.measured).not.toBeNull();
  });

  it("are not there while a joint is not known", () => {
    const [found] = toolFrames(robot(), { joints: [0], goals: [0, 0, 0, 0, 0, 0], unknown: ["turn"] });
    expect(found).toEqual({ label: "Tool", measured: null, goal: null });
  });

  it("have the goal in the frame that the pose names, which may be a camera's", () => {
    const goals = [0.1, 0.2, 0.3, 0, 0, 0];
    const [found] = toolFrames(robot({ frame: "front" }), { joints: [0], goals, unknown: [] });
    expectPose(found?.goal, [0.1, 0.2, 2.3], [0, 0, 0, 1]);
    const blind = { ...robot({ frame: "front" }), cameras: [{ ...CAMERA, calibration: null }] };
    expect(toolFrames(blind, { joints: [0], goals, unknown: [] })[0]?.goal).toBeNull();
  });

  it("turn as measured where a pose has no rotation", () => {
    const [found] = toolFrames(robot({ rotation: ["", "", ""] }), {
      ...{ joints: [Math.PI / 2], goals: [0, 0, 0, 0, 0, 0], unknown: [] },
    });
    expectPose(found?.goal, [0, 0, 0], quarter);
  });
});
