import { describe, expect, it } from "vitest";
import { baseFrame, bindHand, cameraFrame, DEFAULT_HAND, handValues } from "../../src/xr/hand_mapping";
import { PoseDevice, sideOf, type DrivingHands } from "../../src/xr/pose_drive";
import type { Side } from "../../src/xr/headset_input";
import { about, multiply, type Quaternion, type RigidPose, type Vector } from "../../src/util/rigid";
import type { Pose } from "../../src/protocol/wire";
import { axisOf, descriptionOf, feedbackOf, goalAxisOf } from "../messages";
import { randomNumbers } from "../random";

const POSITION = ["x", "y", "z"] as const;
const ROTATION = ["rx", "ry", "rz"] as const;
const AXES = [axisOf("base"), ...[...POSITION, ...ROTATION].map((name) => goalAxisOf(name, { reach: 10 }))];
const TOOL: Pose = {
  ...{ name: "tool", label: "Tool", body: "hand", frame: "", point: [0, 0, 0] },
  ...{ position: POSITION, rotation: ROTATION, instead_of: [], settling: 0 },
};

const AT_ZERO = { position: [0, 0, 0], orientation: [1, 0, 0, 0] } as const;

class Hands implements DrivingHands {
  readonly held = new Map<Side, RigidPose>();
  settingsNow = DEFAULT_HAND;

  pose(side: Side): RigidPose | null {
    return this.held.get(side) ?? null;
  }

  forward(): number {
    return 0;
  }

  readonly panels = new Map<string, Quaternion>();

  panel(camera: string): Quaternion | null {
    return this.panels.get(camera) ?? null;
  }

  settings(): typeof DEFAULT_HAND {
    return this.settingsNow;
  }

  at(side: Side, position: Vector, turn = 0): void {
    this.held.set(side, { position, orientation: about([0, 1, 0], turn) });
  }
}

function feedbackAt(values: readonly number[], event = 5): ReturnType<typeof feedbackOf> {
  return feedbackOf(event, { axes: [0, ...values], goals: [null, ...values] });
}

const PLACE = [0.3, 0.1, 0.2, 0, 0, 1.2];

function expectGoals(found: readonly (number | null)[], expected: readonly (number | null)[]): void {
  expect(found.length).toBe(expected.length);
  for (const [at, value] of expected.entries())
    if (value === null) expect(found[at]).toBeNull();
    else expect(found[at]).toBeCloseTo(value, 6);
}

describe("a hand that takes the deadman", () => {
  it("moves nothing, wherever it is; then the tool follows it", () => {
    const hands = new Hands();
    const device = new PoseDevice({ ...descriptionOf(AXES), poses: [TOOL] }, hands);
    expectGoals(device.goals(feedbackAt(PLACE)), [null, null, null, null, null, null, null]);
    hands.at("right", [5, 1, -3], 2);
    expectGoals(device.goals(feedbackAt(PLACE)), [null, ...PLACE]);
    hands.at("right", [5, 1.1, -3.2], 2.5);
    expectGoals(device.goals(feedbackAt(PLACE)), [null, 0.5, 0.1, 0.3, 0, 0, 1.7]);
  });

  it("leads the tool only once it has come to rest, where it has come to", () => {
    const hands = new Hands();
    const settles = { ...descriptionOf(AXES), poses: [{ ...TOOL, settling: 0.12 }] };
    const device = new PoseDevice(settles, hands);
    hands.at("right", [0, 1, 0]);
    const before = { ...feedbackAt(PLACE), at_rest: false };
    for (const time of [1, 1.06, 1.11])
      expectGoals(device.goals({ ...before, time }), [null, null, null, null, null, null, null]);
    hands.at("right", [0, 1.5, 0], 1);
    const come = [0.28, 0.1, 0.2, 0, 0, 1.2];
    expectGoals(device.goals({ ...feedbackAt(come), time: 1.13 }), [null, ...come]);
  });

  it("takes it again anywhere, and moves nothing", () => {
    const hands = new Hands();
    const device = new PoseDevice({ ...descriptionOf(AXES), poses: [TOOL] }, hands);
    hands.at("right", [0, 1, 0]);
    device.goals(feedbackAt(PLACE));
    hands.held.clear();
    expectGoals(device.goals(feedbackAt(PLACE)), [null, null, null, null, null, null, null]);
    hands.at("left", [-1, 2, 1], -1);
    expectGoals(device.goals(feedbackAt(PLACE, 7)), [null, ...PLACE]);
  });

  it("again while a goal of before may be under way leads nothing until it has been answered", () => {
    const hands = new Hands();
    const device = new PoseDevice({ ...descriptionOf(AXES), poses: [TOOL] }, hands);
    hands.at("right", [0, 1, 0]);
    device.goals(feedbackAt(PLACE));
    hands.at("right", [0, 1.5, 0]);
    device.goals(feedbackAt(PLACE)); // this goal leaves
    hands.held.clear();
    device.goals(feedbackAt(PLACE));
    hands.at("right", [0, 1, 0]);
    for (const event of [5, 6]) {
      expectGoals(device.goals(feedbackAt(PLACE, event)), [null, null, null, null, null, null, null]);
      expect(device.waits).toBe(true);
    }
    const led = [0.3, 0.1, 0.7, 0, 0, 1.2];
    expectGoals(device.goals(feedbackAt(led, 7)), [null, ...led]);
    expect(device.waits).toBe(false);
  });

  it("engages anew after a release, from where the robot is then", () => {
    const hands = new Hands();
    const device = new PoseDevice({ ...descriptionOf(AXES), poses: [TOOL] }, hands);
    hands.at("right", [0, 1, 0]);
    device.goals(feedbackAt(PLACE));
    hands.at("right", [0, 1.5, 0]);
    device.release();
    const elsewhere = [0.4, 0, 0.1, 0, 0, -0.5];
    expectGoals(device.goals(feedbackAt(elsewhere)), [null, ...elsewhere]);
  });

  it("is the one that a pose's name says; two arms have a hand each", () => {
    expect(["tool", "left_tool", "tool.right", "copyright"].map((name) => sideOf({ name }))).toEqual([
      null,
      "left",
      "right",
      null,
    ]);
    const axes = ["l.x", "l.y", "l.z", "r.x", "r.y", "r.z"].map((name) => goalAxisOf(name, { reach: 10 }));
    const none = ["", "", ""] as const;
    const poses: Pose[] = [
      { ...TOOL, name: "left_tool", position: ["l.x", "l.y", "l.z"], rotation: none },
      { ...TOOL, name: "right_tool", position: ["r.x", "r.y", "r.z"], rotation: none },
    ];
    const hands = new Hands();
    const device = new PoseDevice({ ...descriptionOf(axes), poses }, hands);
    const feedback = feedbackOf(5, { axes: [1, 2, 3, 4, 5, 6], goals: [1, 2, 3, 4, 5, 6] });
    hands.at("left", [0, 0, 0]);
    expectGoals(device.goals(feedback), [1, 2, 3, null, null, null]);
    hands.at("right", [9, 9, 9]);
    hands.at("left", [0, 0.1, 0]);
    expectGoals(device.goals(feedback), [1, 2, 3.1, 4, 5, 6]);
  });

  it("leads no pose with an axis that the robot does not have", () => {
    const hands = new Hands();
    const device = new PoseDevice({ ...descriptionOf([goalAxisOf("x")]), poses: [TOOL] }, hands);
    hands.at("right", [0, 0, 0]);
    expectGoals(device.goals(feedbackOf(5, { axes: [0], goals: [0] })), [null]);
  });
});

describe("a pose in the frame of a camera", () => {
  const CAMERAS = ["front", "side"].map((name) => ({
    ...{
      name,
      label: name,
      width: 640,
      height: 480,
      frame_rate: 30,
      metres_per_pixel: null,
      calibration: null,
      click: "",
    },
  }));
  const description = { ...descriptionOf(AXES), cameras: CAMERAS, poses: [{ ...TOOL, frame: "side" }] };

  it("follows the hand as seen in that camera's picture, however the picture stands in the room", () => {
    const hands = new Hands();
    const device = new PoseDevice(description, hands);
    hands.panels.set("side", about([0, 1, 0], -Math.PI / 2)); // on the right, facing left
    hands.at("right", [1, 1, 1]);
    expectGoals(device.goals(feedbackAt(PLACE)), [null, ...PLACE]);
    hands.at("right", [1.1, 1.02, 1.03]); // into the picture, up, and to its right
    expectGoals(device.goals(feedbackAt(PLACE)), [null, 0.33, 0.08, 0.3, 0, 0, 1.2]);
  });

  it("turns the tool as the hand turns in the picture", () => {
    const hands = new Hands();
    const device = new PoseDevice(description, hands);
    hands.panels.set("side", about([0, 1, 0], 0.7));
    hands.at("right", [0, 1, 0]);
    const still = [0, 0, 0, 0, 0, 0];
    device.goals(feedbackAt(still));
    hands.at("right", [0, 1, 0], 0.5); // to the left, about the vertical: about -y, which points up in the picture
    expectGoals(device.goals(feedbackAt(still)), [null, 0, 0, 0, 0, -0.5, 0]);
  });

  it("counts a picture that is not shown as one in front", () => {
    const hands = new Hands();
    const device = new PoseDevice(description, hands);
    hands.at("right", [0, 1, 0]);
    device.goals(feedbackAt(PLACE));
    hands.at("right", [0.1, 1, -0.2]);
    expectGoals(device.goals(feedbackAt(PLACE)), [null, 0.4, 0.1, 0.4, 0, 0, 1.2]);
  });

  it("holds still what the operator locks, in the operator's own directions", () => {
    const hands = new Hands();
    const device = new PoseDevice(description, hands);
    hands.settingsNow = { ...DEFAULT_HAND, locked: { ...DEFAULT_HAND.locked, x: true, z: true } };
    hands.at("right", [0, 1, 0]);
    device.goals(feedbackAt(PLACE));
    hands.at("right", [0.1, 1.3, -0.2]);
    expectGoals(device.goals(feedbackAt(PLACE)), [null, 0.4, 0.1, 0.2, 0, 0, 1.2]);
  });

  it("is that of the body where a body has the camera's name", () => {
    const hands = new Hands();
    const side = { name: "side", parent: "", joints: [], geoms: [], ...AT_ZERO };
    const device = new PoseDevice({ ...description, bodies: [side] }, hands);
    hands.at("right", [0, 1, 0]);
    device.goals(feedbackAt(PLACE));
    hands.at("right", [0, 1, -0.1]);
    expectGoals(device.goals(feedbackAt(PLACE)), [null, 0.4, 0.1, 0.2, 0, 0, 1.2]);
  });
});

it("the first goal is where the robot is, for any hand, robot, heading and setting", () => {
  const random = randomNumbers(3);
  const some = (size: number): number => (random() - 0.5) * size;
  for (let turn = 0; turn < 300; turn++) {
    const rotation: Vector = [some(7), some(7), some(7)];
    const orientation = multiply(about([0, 1, 0], some(6)), about([1, 0, 0], some(6)));
    const hand = { position: [some(4), some(4), some(4)] as const, orientation };
    const settings = { ...DEFAULT_HAND, scale: random() * 2, view: some(6) };
    const frame = turn % 2 === 0 ? baseFrame(some(6), settings) : cameraFrame(about([0, 1, 0], some(6)));
    const values = handValues(bindHand(hand, rotation, frame, settings), hand);
    for (const [at, value] of [0, 0, 0, ...rotation].entries()) expect(values[at]).toBeCloseTo(value, 6);
  }
});

it("a small motion of the hand is a small one of the tool, through any turns", () => {
  const random = randomNumbers(11);
  let hand: RigidPose = { position: [0, 1, 0], orientation: [0, 0, 0, 1] };
  const binding = bindHand(hand, [0, 0, 0], baseFrame(0.4, DEFAULT_HAND), DEFAULT_HAND);
  let last = handValues(binding, hand);
  for (let step = 0; step < 2000; step++) {
    // Turns about one axis for a while, so that it goes through whole revolutions.
    const axis = (
      [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
      ] as const
    )[Math.floor(step / 250) % 3] ?? [1, 0, 0];
    const orientation = multiply(about(axis, 0.03), hand.orientation);
    hand = { position: [hand.position[0] + 0.001, 1 + random() * 0.001, 0], orientation };
    const values = handValues(binding, hand);
    const before = about3(last);
    const after = about3(values);
    const turned = Math.abs(
      after[0] * before[0] + after[1] * before[1] + after[2] * before[2] + after[3] * before[3],
    );
    expect(2 * Math.acos(Math.min(1, turned))).toBeLessThan(0.031);
    last = values;
  }
});

function about3(values: readonly number[]): readonly [number, number, number, number] {
  const [, , , x = 0, y = 0, z = 0] = values;
  const angle = Math.hypot(x, y, z);
  return angle === 0 ? [0, 0, 0, 1] : about([x / angle, y / angle, z / angle], angle);
}
