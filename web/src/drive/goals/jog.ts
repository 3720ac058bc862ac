import type { Axis } from "../../protocol/wire";
import { REACH_SHARE, wayTo, type AxisValue } from "./goal_range";

/**
 * How far ahead of the newest applied goal a jogged one is at most: what the axis goes in this time, and what it brakes
 * in. On a long path the applied goal is old by the way back, and the command by the way there: a robot that arrives
 * before the next command stops and goes.
 */
const LEAD_SECONDS = 0.8;
/** Of the usable reach. */
const LEAD_SHARE = 0.75;
/** A page that was held up does not make up for it. */
export const LONGEST_STEP_MS = 50;

/** One goal axis that a stick, a key or a push moves on. */
export interface Jog {
  goal: AxisValue; // null: nobody moves it
  atMs: number; // of the last step
}

/** Where the axis is, of the newest feedback. */
export interface AxisPlace {
  readonly applied: number; // the goal that the robot applies
  readonly measured: number;
}

export function createJog(): Jog {
  return { goal: null, atMs: 0 };
}

/**
 * The goal of an axis that is moved on at `rate` (its unit/s; 0: let go, the axis stays). The first goal is the applied
 * one, so that beginning moves nothing; from then on the goal leads the applied one by a little. A goal that is behind
 * it, because the direction has changed, begins anew. `place` is null where it is not known: then nothing moves.
 */
export function stepJog(jog: Jog, axis: Axis, rate: number, place: AxisPlace | null, now: number): AxisValue {
  const stepMs = Math.min(LONGEST_STEP_MS, Math.max(0, now - jog.atMs));
  jog.atMs = now;
  if (place === null || rate === 0 || !Number.isFinite(rate)) return (jog.goal = null);
  const direction = Math.sign(rate);
  const ahead = jog.goal === null ? 0 : Math.max(0, direction * wayTo(axis, place.applied, jog.goal));
  const step = jog.goal === null ? 0 : (Math.abs(rate) * stepMs) / 1000;
  const lead = Math.min(ahead + step, longestLead(axis, rate), roomAhead(axis, direction, place));
  return (jog.goal = place.applied + direction * Math.max(0, lead));
}

/** So that the robot moves steadily, and is never told to go far by one command. */
export function longestLead(axis: Axis, rate: number): number {
  const acceleration = axis.acceleration > 0 ? axis.acceleration : axis.brake;
  const braking = acceleration > 0 ? (rate * rate) / (2 * acceleration) : 0;
  return Math.min(Math.abs(rate) * LEAD_SECONDS + braking, LEAD_SHARE * REACH_SHARE * axis.reach);
}

/** To the end of the axis, and to the share of reach from the measured value; what is beyond it may only come back. */
function roomAhead(axis: Axis, direction: number, { applied, measured }: AxisPlace): number {
  const toReach = direction * wayTo(axis, applied, measured) + REACH_SHARE * axis.reach;
  if (axis.wrap !== null) return toReach;
  const end = direction > 0 ? axis.maximum : axis.minimum;
  return Math.min(toReach, direction * (end - applied));
}
