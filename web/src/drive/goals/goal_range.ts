import type { Axis } from "../../protocol/wire";

/** Of an axis' reach that goals use: the robot moves on while a command travels. The Python client has the same share. */
export const REACH_SHARE = 0.8;

/** A value of an axis; null where a goal axis is to stay. */
export type AxisValue = number | null;

type Wrapping = Pick<Axis, "wrap">;

/** The way from one place to another; on an axis that turns on and on the shorter one. */
export function wayTo({ wrap }: Wrapping, from: number, to: number): number {
  const way = to - from;
  if (wrap === null || !(wrap > 0)) return way;
  const turns = way / wrap;
  return way - wrap * Math.sign(turns) * Math.ceil(Math.abs(turns) - 0.5);
}

/**
 * The goal nearest to `wanted` that is within the share of reach of the measured value. The applied goal is within it
 * even if a load has moved the robot far from it: engaging must move nothing.
 */
export function withinReach(
  axis: Pick<Axis, "reach">,
  wanted: number,
  measured: number,
  applied: number,
): number {
  const reach = REACH_SHARE * axis.reach;
  const least = Math.min(measured - reach, applied);
  const most = Math.max(measured + reach, applied);
  return Math.min(most, Math.max(least, wanted));
}
