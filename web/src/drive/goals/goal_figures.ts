import type { Axis } from "../../protocol/wire";
import { quantity, scaleFor } from "../../util/units";
import { wayTo } from "./goal_range";

/** An axis that is nearer to an end of its range than this share of the range counts as at its end. */
const AT_END = 0.004;
const DEGREES = 180 / Math.PI;

/** Where something stands on the bar of an axis: 0 at the least value, 1 at the largest. */
export function shareOf(axis: Axis, place: number): number {
  const range = axis.maximum - axis.minimum || 1;
  const middle = (axis.minimum + axis.maximum) / 2;
  const share = (middle + wayTo(axis, middle, place) - axis.minimum) / range;
  return Math.min(1, Math.max(0, share));
}

/** Which end of its range an axis is at; null: at none, or it has none. */
export function endOf(axis: Axis, place: number): "minimum" | "maximum" | null {
  if (axis.wrap !== null) return null;
  const least = AT_END * (axis.maximum - axis.minimum);
  if (place <= axis.minimum + least) return "minimum";
  return place >= axis.maximum - least ? "maximum" : null;
}

/** A place in words: what people read it in, and beside it what the robot says it in, if that is another unit. */
export function figureOf(axis: Axis, place: number): { readonly main: string; readonly beside: string } {
  const scale = scaleFor(axis.unit, Math.max(Math.abs(axis.minimum), Math.abs(axis.maximum)));
  const own = quantity(place, scale);
  if (axis.unit !== "rad" || axis.kind !== "goal") return { main: own, beside: "" };
  return { main: degreesOf(place, 1), beside: own };
}

/** An end of the range, short. */
export function endLabel(axis: Axis, place: number): string {
  if (axis.unit === "rad") return degreesOf(place, 0);
  const { factor } = scaleFor(axis.unit, Math.max(Math.abs(axis.minimum), Math.abs(axis.maximum)));
  return String(Number((place * factor).toPrecision(3)));
}

function degreesOf(radians: number, digits: number): string {
  const text = (radians * DEGREES).toFixed(digits);
  return `${/[1-9]/.test(text) ? text : text.replace("-", "")}°`;
}
