import { inputFor, type HeldInputs } from "../axis_mapping";
import type { Axis, ControlLayer, Feedback, Refusal, RobotDescription } from "../../protocol/wire";
import { Clutch, settlingOf } from "./clutch";
import type { AxisValue } from "./goal_range";
import type { GoalRefusal } from "./goal_refusal";
import { createJog, stepJog, type AxisPlace, type Jog } from "./jog";
import { createTurnJog, stepTurn, type Three, type TurnJog } from "./turn_jog";

/** Most waits are shorter: they need no words. */
const SAID_AFTER_MS = 300;

/** A device that has a pose and drives goal axes by a clutch of its own: a headset, a leader arm. */
export interface GoalDevice {
  readonly waits: boolean; // its operator wants to drive, and its clutch waits until the robot stands still
  /** One value for each axis of the robot, null where it drives none. Asked only while its operator may drive. */
  goals(feedback: Feedback): readonly AxisValue[];
  /** Driving has ended, for whatever reason: it engages anew. */
  release(): void;
}

/** The inputs that drive goal axes at one moment. */
export interface GoalInputs {
  readonly description: RobotDescription;
  readonly layer: ControlLayer | undefined;
  readonly held: HeldInputs;
  readonly share: number; // of full speed
  readonly feedback: Feedback | null; // newest
  readonly moves: boolean; // the next command may move the robot
}

interface GoalAxis {
  readonly index: number;
  readonly axis: Axis;
  readonly jog: Jog;
  readonly clutch: Clutch; // of its slider
}

/** The rotation of a pose. */
interface GoalTurn {
  readonly axes: Three<GoalAxis>;
  readonly jog: TurnJog;
}

/** What leads a goal axis besides the keys and sticks of its own. */
interface Led {
  readonly posed: AxisValue; // by the device
  readonly isIdle: boolean; // a pose moves the axis instead
  readonly turned: readonly [AxisValue, number] | undefined; // as a part of its pose's rotation
}

/**
 * The values of a robot's goal axes. Sticks, keys and pushes jog them, sliders and devices drive them by a clutch;
 * null where nobody does. Whenever the next command may not move the robot, everything is let go, and the first goal
 * after that is the applied one.
 */
export class GoalDriving {
  speed = 1; // of the axes' largest speed that the next command uses at most
  refusal: GoalRefusal | null = null; // the newest
  device: GoalDevice | null = null;
  waitsSinceMs: number | null = null; // a slider or the device is held, and moves nothing until the robot stands still
  private description: RobotDescription | null = null;
  private axes: readonly GoalAxis[] = [];
  private turns: readonly GoalTurn[] = [];

  /** `values` with those of the goal axes put in. */
  take(values: readonly AxisValue[], inputs: GoalInputs, now: number): readonly AxisValue[] {
    const { description, feedback } = inputs;
    if (description !== this.description) this.takeRobot(description);
    if (this.axes.length === 0) return values;
    if (!inputs.moves || feedback === null) {
      this.release();
      return values;
    }
    const posed = this.device?.goals(feedback) ?? [];
    const idle = replaced(description, posed);
    const taken = [...values];
    const turned = this.turned(posed, idle, inputs, feedback, now);
    let fastest = 0;
    for (const each of this.axes) {
      const isIdle = idle.has(each.axis.name);
      const led = { posed: posed[each.index] ?? null, isIdle, turned: turned.get(each.index) };
      const [goal, share] = this.goalOf(each, led, inputs, feedback, now);
      taken[each.index] = goal;
      fastest = Math.max(fastest, share);
    }
    const waits = this.device?.waits === true || this.axes.some(({ clutch }) => clutch.waits);
    this.waitsSinceMs = waits ? (this.waitsSinceMs ?? now) : null;
    this.speed = fastest * inputs.share;
    return taken;
  }

  /** Whether somebody wants to drive and has waited for so long that the page says for what. */
  saysWhatItWaitsFor(now: number): boolean {
    return this.waitsSinceMs !== null && now - this.waitsSinceMs >= SAID_AFTER_MS;
  }

  /** Nobody drives: each hand engages anew. */
  release(): void {
    this.speed = 1;
    this.waitsSinceMs = null;
    for (const { jog, clutch } of this.axes) {
      jog.goal = null;
      clutch.lostFeedback();
    }
    for (const { jog } of this.turns) jog.goal = null;
    this.device?.release();
  }

  /** A goal was refused: what leads the robot begins again where the robot is. */
  refused(refusal: Refusal, now: number): void {
    const { reason, detail } = refusal;
    if (reason !== "jump" && reason !== "conflict") return;
    this.refusal = { reason, detail, atMs: now };
    this.release();
  }

  private takeRobot(description: RobotDescription): void {
    this.release();
    this.description = description;
    this.axes = description.axes.flatMap((axis, index) => {
      if (axis.kind !== "goal") return [];
      const settling = settlingOf(description, axis.name);
      return [{ index, axis, jog: createJog(), clutch: new Clutch([{ index, axis, scale: 1, settling }]) }];
    });
    this.turns = description.poses.flatMap(({ rotation }) => {
      const [x, y, z] = rotation.map((name) => this.axes.find(({ axis }) => axis.name === name));
      return x && y && z ? [{ axes: [x, y, z] as const, jog: createTurnJog() }] : [];
    });
  }

  /** By the axes' indices: goals and shares of poses' rotations that keys, sticks and pushes turn, or nobody does. */
  private turned(
    posed: readonly AxisValue[],
    idle: ReadonlySet<string>,
    { layer, held, share }: GoalInputs,
    feedback: Feedback,
    now: number,
  ): ReadonlyMap<number, readonly [AxisValue, number]> {
    const turned = new Map<number, readonly [AxisValue, number]>();
    for (const { axes, jog } of this.turns) {
      const isLed = axes.some(
        ({ index, axis }) =>
          typeof posed[index] === "number" ||
          idle.has(axis.name) ||
          held.sliders?.travels[axis.name] !== undefined,
      );
      if (isLed) {
        jog.goal = null;
        continue;
      }
      const each = <T>(of: (axis: GoalAxis) => T): Three<T> => [of(axes[0]), of(axes[1]), of(axes[2])];
      const rates = each(({ axis }) => pushOf(axis, layer, held) * share * axis.slew);
      const places = each(({ index, axis }) => placeOf(feedback, index, axis));
      const [x, y, z] = places;
      const { goals, speed } = stepTurn(
        jog,
        each(({ axis }) => axis),
        rates,
        x && y && z ? [x, y, z] : null,
        now,
      );
      for (const [part, { index }] of axes.entries())
        turned.set(index, [goals[part] ?? null, share > 0 ? Math.min(1, speed / share) : 0]);
    }
    return turned;
  }

  /** Goal, and the share of the axis' largest speed that it needs. */
  private goalOf(
    { index, axis, jog, clutch }: GoalAxis,
    { posed, isIdle, turned }: Led,
    { layer, held, share }: GoalInputs,
    feedback: Feedback,
    now: number,
  ): readonly [AxisValue, number] {
    const place = placeOf(feedback, index, axis);
    clutch.observe(feedback); // also while nobody drags: it has to see that its goal stands still
    const isFree = place !== null && posed === null && !isIdle;
    const travel = isFree ? held.sliders?.travels[axis.name] : undefined;
    if (travel === undefined) clutch.release(); // a slider that is held goes on from where the pose has led its axis
    const led = travel !== undefined ? drag(clutch, axis, travel) : isIdle ? null : posed;
    const input = led === null && !isIdle && turned === undefined ? pushOf(axis, layer, held) : 0;
    const jogged = stepJog(jog, axis, input * share * axis.slew, place, now);
    if (led !== null) return [led, 1];
    if (turned !== undefined) return turned;
    return [jogged, jogged === null ? 0 : Math.min(1, Math.abs(input))];
  }
}

/** From -1 to 1, what keys, sticks and pushes ask of an axis. */
function pushOf(axis: Axis, layer: ControlLayer | undefined, held: HeldInputs): number {
  return held.sliders?.pushes[axis.name] ?? inputFor(axis, layer, held);
}

/** The axes that a device drives by a pose instead: a command for both is refused. */
function replaced({ axes, poses }: RobotDescription, posed: readonly AxisValue[]): ReadonlySet<string> {
  const led = new Set(
    axes.filter((_axis, index) => typeof posed[index] === "number").map(({ name }) => name),
  );
  const driven = poses.filter(({ position, rotation }) =>
    [...position, ...rotation].some((name) => led.has(name)),
  );
  return new Set(driven.flatMap(({ instead_of }) => instead_of));
}

/** `travel`: of the slider since it was taken, as a share of the axis' range. */
function drag(clutch: Clutch, axis: Axis, travel: number): AxisValue {
  const reading = [travel * (axis.maximum - axis.minimum)];
  if (!clutch.engaged) clutch.engage(reading);
  return clutch.goals(reading)[0] ?? null;
}

function placeOf(feedback: Feedback, index: number, axis: Axis): AxisPlace | null {
  const applied = feedback.goals[index];
  const measured = feedback.axes[index];
  if (typeof applied !== "number" || measured === undefined || feedback.unknown.includes(axis.name))
    return null;
  return { applied, measured };
}
