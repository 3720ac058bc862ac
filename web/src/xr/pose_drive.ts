import { clutchOf, type Clutch } from "../drive/goals/clutch";
import type { GoalDevice } from "../drive/goals/goal_driving";
import type { AxisValue } from "../drive/goals/goal_range";
import type { Feedback, Pose, RobotDescription } from "../protocol/wire";
import {
  baseFrame,
  bindHand,
  cameraFrame,
  handValues,
  type HandBinding,
  type HandFrame,
  type HandSettings,
} from "./hand_mapping";
import type { Side } from "./headset_input";
import { about, type Quaternion, type RigidPose, type Vector } from "../util/rigid";

/** The hands that may drive now. */
export interface DrivingHands {
  /** In the headset's space; null: not tracked, or it does not hold the deadman. */
  pose(side: Side): RigidPose | null;
  forward(): number; // the operator's heading in that space, rad
  panel(camera: string): Quaternion | null; // how a camera's picture stands in that space; null: it is not shown
  settings(): HandSettings;
}

/** A pose of the robot, and the hand that leads it while it is engaged. */
interface PoseDrive {
  readonly pose: Pose;
  readonly side: Side | null; // null: whichever hand holds the deadman
  readonly names: readonly string[]; // of its six axes; "" for one that it lacks
  readonly clutch: Clutch; // of those that it has
  leading: { readonly side: Side; readonly binding: HandBinding } | null;
}

const SIDES: readonly Side[] = ["right", "left"];

/**
 * Hands drive the poses of a description. Each engages when its hand takes the deadman: the pose goes on from where the
 * robot is, and follows the hand's own motion from there.
 */
export class PoseDevice implements GoalDevice {
  private readonly drives: readonly PoseDrive[];

  constructor(
    private readonly description: RobotDescription,
    private readonly hands: DrivingHands,
  ) {
    this.drives = description.poses.flatMap((pose) => {
      const names = [...pose.position, ...pose.rotation];
      const clutch = clutchOf(
        description,
        names.filter((name) => name !== "").map((name) => [name, 1] as const),
      );
      return clutch === null ? [] : [{ pose, side: sideOf(pose), names, clutch, leading: null }];
    });
  }

  get waits(): boolean {
    return this.drives.some(({ clutch }) => clutch.waits);
  }

  goals(feedback: Feedback): readonly AxisValue[] {
    const goals: AxisValue[] = this.description.axes.map(() => null);
    const taken = new Set<Side>();
    for (const drive of this.drives) {
      drive.clutch.observe(feedback); // also while nobody leads it: the clutch has to see that its goals stand still
      const side = this.sideFor(drive, taken);
      if (side === null) {
        letGo(drive);
        continue;
      }
      taken.add(side);
      const found = this.lead(drive, side, feedback);
      for (const [at, name] of drive.names.filter((each) => each !== "").entries()) {
        const index = this.description.axes.findIndex((axis) => axis.name === name);
        goals[index] = found[at] ?? null;
      }
    }
    return goals;
  }

  release(): void {
    for (const drive of this.drives) {
      letGo(drive);
      drive.clutch.lostFeedback();
    }
  }

  /** The hand that leads this pose now; one hand leads one pose. */
  private sideFor({ side, leading }: PoseDrive, taken: ReadonlySet<Side>): Side | null {
    const holds = (each: Side): boolean => !taken.has(each) && this.hands.pose(each) !== null;
    if (side !== null) return holds(side) ? side : null;
    if (leading !== null && holds(leading.side)) return leading.side;
    return SIDES.find(holds) ?? null;
  }

  private lead(drive: PoseDrive, side: Side, feedback: Feedback): readonly AxisValue[] {
    const hand = this.hands.pose(side);
    if (hand === null) return [];
    if (drive.leading?.side !== side || !drive.clutch.engaged) {
      const binding = bindHand(
        hand,
        this.rotation(drive, feedback),
        this.frame(drive.pose),
        this.hands.settings(),
      );
      drive.leading = { side, binding };
      drive.clutch.engage(present(drive, handValues(binding, hand)));
    }
    return drive.clutch.goals(present(drive, handValues(drive.leading.binding, hand)));
  }

  /** The frame of a body counts as the robot's base. A camera that is not shown would stand in front. */
  private frame({ frame }: Pose): HandFrame {
    const { bodies, cameras } = this.description;
    const isCamera = cameras.some(({ name }) => name === frame) && !bodies.some(({ name }) => name === frame);
    if (!isCamera) return baseFrame(this.hands.forward(), this.hands.settings());
    return cameraFrame(this.hands.panel(frame) ?? about([0, 1, 0], this.hands.forward()));
  }

  /** The applied goal of the pose's rotation. */
  private rotation({ pose }: PoseDrive, { goals }: Feedback): Vector {
    const valueOf = (name: string): number =>
      goals[this.description.axes.findIndex((axis) => axis.name === name)] ?? 0;
    return [valueOf(pose.rotation[0]), valueOf(pose.rotation[1]), valueOf(pose.rotation[2])];
  }
}

/** Whose hand a pose is by its name: "left_tool", "tool.right"; null: either's. */
export function sideOf({ name }: Pick<Pose, "name">): Side | null {
  const side = /(?:^|[._-])(left|right)(?:$|[._-])/.exec(name)?.[1];
  return side === "left" || side === "right" ? side : null;
}

function letGo(drive: PoseDrive): void {
  drive.leading = null;
  drive.clutch.release();
}

function present({ names }: PoseDrive, values: readonly number[]): number[] {
  return values.filter((_value, at) => names[at] !== "");
}
