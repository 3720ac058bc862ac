import { eventAfter } from "../../gate/serial";
import type { Axis, Feedback, RobotDescription } from "../../protocol/wire";
import { wayTo, withinReach, type AxisValue } from "./goal_range";

/** A goal axis that a device drives. */
export interface ClutchAxis {
  readonly index: number; // of the axis in the description
  readonly axis: Pick<Axis, "reach" | "wrap">;
  readonly scale: number; // goal for the device's motion, in units of the axis; negative: mirrored
  readonly settling?: number; // s, of its pose
}

/** The bound places of one axis. Places of an axis with `wrap` are counted on past its period: a turn keeps its direction. */
interface Binding extends ClutchAxis {
  origin: number; // the applied goal at which it was engaged
  device: number; // newest reading
  motion: number; // of the device since it was engaged
  measured: number;
  applied: number;
}

/** The measured values and applied goals that a clutch binds to. */
type Measured = Pick<Feedback, "at_rest" | "axes" | "event" | "goals" | "neutral_needed" | "stop" | "time">;

/**
 * A clutch between a device that has a pose and goal axes (docs/robot-link.md, "The clutch"): engaging moves nothing,
 * then the goals follow the device. It holds no clock and no connection. `observe` every feedback, `engage` when the
 * operator asks for it, and drive what `goals` returns. It engages only while the goals of its axes stand still: a goal
 * that still brakes, or a pose that has not settled, is not where the robot comes to rest. Nor does it engage while a
 * goal that it gave before may still be under way: not before the second event after the feedback that it was made for.
 *
 * A goal further than a share of the axis' reach from the newest measured value is clipped there; the device's motion
 * counts on meanwhile. Call `release` when the operator lets go, and when the seat or the arming is lost. The clutch
 * releases itself when a reading is not known and when the robot needs a neutral command. The Python client has the same
 * class, and both pass tests/vectors/clutch.json.
 */
export class Clutch {
  private readonly bindings: readonly Binding[];
  private readonly settling: number; // s
  private newest: Measured | null = null;
  private given: number | null = null; // event of the feedback for which it gave a goal last
  private stoodAt = 0; // robot's time of the first feedback with the goals of the newest one
  private isEngaged = false;
  private isWaiting = false;
  private clippedAxes: readonly number[] = [];

  constructor(axes: readonly ClutchAxis[]) {
    this.bindings = axes.map((each) => ({
      ...each,
      origin: 0,
      device: 0,
      motion: 0,
      measured: 0,
      applied: 0,
    }));
    this.settling = Math.max(0, ...axes.map(({ settling = 0 }) => settling));
  }

  /** Whether the goals follow the device. */
  get engaged(): boolean {
    return this.isEngaged;
  }

  /** Whether it was not engaged only because its goals do not stand still yet, or one may be under way. */
  get waits(): boolean {
    return this.isWaiting;
  }

  /** The axes, by number in this clutch, whose newest goal is nearer than the device asks for. */
  get clipped(): readonly number[] {
    return this.clippedAxes;
  }

  /** Takes the newest feedback. One without the axes' goals and measured values counts as lost. */
  observe(feedback: Measured): void {
    if (!this.isUsable(feedback)) {
      this.lostFeedback();
      return;
    }
    const { newest } = this;
    if (newest === null || this.bindings.some(({ index }) => feedback.goals[index] !== newest.goals[index]))
      this.stoodAt = feedback.time;
    this.newest = feedback;
    if (!this.isEngaged) return;
    for (const each of this.bindings) {
      each.measured += wayTo(each.axis, each.measured, feedback.axes[each.index] ?? 0);
      each.applied = each.measured + wayTo(each.axis, each.measured, feedback.goals[each.index] ?? 0);
    }
  }

  /**
   * Binds the device's readings, one for each axis of the clutch, to the applied goals of the newest feedback; again, if
   * it is engaged. Says whether it is engaged now: not without a feedback, not with a reading that is not known, and not
   * before the goals stand still and none is under way (`waits`).
   */
  engage(device: readonly AxisValue[]): boolean {
    this.release();
    const { newest } = this;
    if (newest === null || !isKnown(device, this.bindings.length)) return false;
    this.isWaiting =
      this.isUnderWay(newest) || !(newest.at_rest || newest.time - this.stoodAt > this.settling);
    if (this.isWaiting) return false;
    for (const [at, each] of this.bindings.entries()) {
      each.origin = each.applied = newest.goals[each.index] ?? 0;
      each.measured = each.origin + wayTo(each.axis, each.origin, newest.axes[each.index] ?? 0);
      each.device = device[at] ?? 0;
      each.motion = 0;
    }
    return (this.isEngaged = true);
  }

  /** One goal for each axis of the clutch; null for each unless it is engaged. */
  goals(device: readonly AxisValue[]): AxisValue[] {
    if (!isKnown(device, this.bindings.length)) this.release();
    if (!this.isEngaged || this.newest === null) return this.bindings.map(() => null);
    this.given = this.newest.event;
    const clipped: number[] = [];
    const goals = this.bindings.map((each, at) => {
      const reading = device[at] ?? 0;
      each.motion += wayTo(each.axis, each.device, reading);
      each.device = reading;
      const wanted = each.origin + each.scale * each.motion;
      const goal = withinReach(each.axis, wanted, each.measured, each.applied);
      if (goal !== wanted) clipped.push(at);
      return goal;
    });
    this.clippedAxes = clipped;
    return goals;
  }

  /** Lets go: the goals are null until it is engaged anew, anywhere. */
  release(): void {
    this.isEngaged = this.isWaiting = false;
    this.clippedAxes = [];
  }

  /** Lets go, and does not engage before another feedback: the newest one may be of another state, or another run. */
  lostFeedback(): void {
    this.release();
    this.newest = this.given = null;
  }

  /**
   * Whether a goal from before it was released may execute after this feedback: it left in the command after its own
   * feedback or, made ready before its turn, in the one after that.
   */
  private isUnderWay({ event }: Measured): boolean {
    return this.given !== null && (event === this.given || event === eventAfter(this.given));
  }

  private isUsable(feedback: Measured): boolean {
    if (feedback.neutral_needed || feedback.stop.stopped) return false;
    return this.bindings.every(
      ({ index }) => isNumber(feedback.axes[index]) && isNumber(feedback.goals[index]),
    );
  }
}

/** The clutch of a device with a reading for each of these goal axes, by name; null: the robot does not have them all. */
export function clutchOf(
  description: RobotDescription,
  scales: readonly (readonly [axis: string, scale: number])[],
): Clutch | null {
  const axes: ClutchAxis[] = [];
  for (const [name, scale] of scales) {
    const index = description.axes.findIndex((axis) => axis.name === name);
    const axis = description.axes[index];
    if (axis?.kind !== "goal" || !Number.isFinite(scale)) return null;
    axes.push({ index, axis, scale, settling: settlingOf(description, name) });
  }
  return new Clutch(axes);
}

/** For how long the robot may still come nearer to a goal of this axis that stands still, s. */
export function settlingOf({ poses }: RobotDescription, axis: string): number {
  return poses.find(({ position, rotation }) => [...position, ...rotation].includes(axis))?.settling ?? 0;
}

function isKnown(device: readonly AxisValue[], count: number): device is readonly number[] {
  return device.length === count && device.every(isNumber);
}

function isNumber(value: AxisValue | undefined): value is number {
  return typeof value === "number" && Number.isFinite(value);
}
