import type { Axis } from "../../protocol/wire";
import {
  about,
  inverse,
  multiply,
  nearestRotationVector,
  ofRotationVector,
  rotationVector,
  type Quaternion,
  type Vector,
} from "../../util/rigid";
import type { AxisValue } from "./goal_range";
import { REACH_SHARE } from "./goal_range";
import { LONGEST_STEP_MS, longestLead, type AxisPlace } from "./jog";

export type Three<T> = readonly [T, T, T];

/** Halvings of a lead that an axis' bound does not allow: to a thousandth of it. */
const HALVINGS = 10;
/** rad, by which a difference is taken in place of a derivative. */
const SMALL = 1e-4;

/** The rotation of a pose that sticks, keys or pushes turn on. */
export interface TurnJog {
  goal: Vector | null; // null: nobody turns it
  axis: Vector; // about which it is turned, in the pose's frame
  from: Quaternion; // where that turn began
  atMs: number; // of the last step
}

export interface Turned {
  readonly goals: Three<AxisValue>;
  readonly speed: number; // of the axes' largest speed that the turn needs
}

const STAYS: Turned = { goals: [null, null, null], speed: 0 };

export function createTurnJog(): TurnJog {
  return { goal: null, axis: [0, 0, 0], from: [0, 0, 0, 1], atMs: 0 };
}

/**
 * The goals of a pose whose rotation is turned on at `rates` (rad/s about the axes of its frame; all 0: let go, it
 * stays). The goals are a rotation vector, whose components are turns about the frame's axes only near zero: turned by
 * components, a tool that points down would turn about a line half way between two axes. Like `stepJog`, it begins at
 * the applied goal, leads it by a little, and is never ahead of what the axes' bounds and reach allow. The bridge leads
 * each component to its goal by itself, so the turn goes on from where it began: else it would drift.
 */
export function stepTurn(
  jog: TurnJog,
  axes: Three<Axis>,
  rates: Vector,
  places: Three<AxisPlace> | null,
  now: number,
): Turned {
  const stepMs = Math.min(LONGEST_STEP_MS, Math.max(0, now - jog.atMs));
  jog.atMs = now;
  const rate = Math.hypot(...rates);
  if (places === null || rate === 0 || !Number.isFinite(rate)) {
    jog.goal = null;
    return STAYS;
  }
  const applied: Vector = [places[0].applied, places[1].applied, places[2].applied];
  const axis: Vector = [rates[0] / rate, rates[1] / rate, rates[2] / rate];
  const place = ofRotationVector(applied);
  const leads = jog.goal !== null;
  const isSame = leads && along(jog.axis, axis) > 1 - 1e-9;
  if (!isSame) Object.assign(jog, { axis, from: place });
  const turned = turnAbout(axis, place, jog.from);
  const ahead = jog.goal === null ? 0 : Math.max(0, turnAbout(axis, ofRotationVector(jog.goal), place));
  const lead = Math.min(
    ahead + (leads ? (rate * stepMs) / 1000 : 0),
    ...axes.map((each) => longestLead(each, rate)),
  );
  const goalAt = (angle: number): Vector =>
    nearestRotationVector(rotationVector(multiply(about(axis, turned + angle), jog.from)), applied);
  jog.goal = leads ? (furthest(goalAt, lead, axes, places) ?? applied) : applied;
  return { goals: jog.goal, speed: speedOf(goalAt, rate, axes) };
}

/** How far `to` is turned from `from` about an axis, rad. */
function turnAbout(axis: Vector, to: Quaternion, from: Quaternion): number {
  return along(axis, rotationVector(multiply(to, inverse(from))));
}

function along(axis: Vector, vector: Vector): number {
  return axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2];
}

/** The goal furthest ahead that all axes allow; null: none, not even without a lead. */
function furthest(
  goalAt: (angle: number) => Vector,
  lead: number,
  axes: Three<Axis>,
  places: Three<AxisPlace>,
): Vector | null {
  const isAllowed = (goal: Vector): boolean =>
    goal.every((value, part) => isWithin(value, axes[part] as Axis, places[part] as AxisPlace));
  const whole = goalAt(lead);
  if (isAllowed(whole)) return whole;
  let [least, most] = [0, lead];
  let best = goalAt(0);
  if (!isAllowed(best)) return null;
  for (let halving = 0; halving < HALVINGS; halving += 1) {
    const middle = (least + most) / 2;
    const goal = goalAt(middle);
    if (isAllowed(goal)) [least, best] = [middle, goal];
    else most = middle;
  }
  return best;
}

/** What is beyond a bound already may only stay or come back. */
function isWithin(value: number, axis: Axis, { applied, measured }: AxisPlace): boolean {
  const reach = REACH_SHARE * axis.reach;
  const least = Math.min(applied, Math.max(axis.minimum, measured - reach));
  const most = Math.max(applied, Math.min(axis.maximum, measured + reach));
  return value >= least - 1e-9 && value <= most + 1e-9;
}

/** As a share of the axes' largest speed: what the component that changes the fastest needs, 1 at most. */
function speedOf(goalAt: (angle: number) => Vector, rate: number, axes: Three<Axis>): number {
  const [here, there] = [goalAt(0), goalAt(SMALL)];
  const speeds = axes.map(
    ({ slew }, part) => (rate * Math.abs((there[part] as number) - (here[part] as number))) / SMALL / slew,
  );
  return Math.min(1, Math.max(...speeds));
}
