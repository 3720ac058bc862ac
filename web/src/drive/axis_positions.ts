import type { Feedback, RobotDescription } from "../protocol/wire";
import { quantity, scaleFor, type Scale } from "../util/units";

/** A measured joint that one axis alone moves: its operator wants to know where it is. */
export interface AxisPosition {
  readonly label: string; // "Probe height"
  readonly joint: number; // its number in the feedback
  readonly name: string; // its name, by which a feedback says that it is not known
  readonly scale: Scale;
}

/** Those of a robot, in the order of its position limits. */
export function axisPositionsOf(description: RobotDescription): AxisPosition[] {
  return description.position_limits.flatMap((limit) => {
    const joint = description.joints.findIndex((each) => each.name === limit.joint);
    const [axis] = limit.axes;
    if (joint < 0 || limit.axes.length !== 1 || axis === undefined || axis.gain === null) return [];
    const unit = description.joints[joint]?.unit ?? "m";
    const magnitude = Math.max(Math.abs(limit.minimum ?? 0), Math.abs(limit.maximum ?? 0));
    const { digits, ...scale } = scaleFor(unit, magnitude);
    // One digit more than a speed has: where something is matters to its smallest step.
    return [{ label: limit.label, joint, name: limit.joint, scale: { ...scale, digits: digits + 1 } }];
  });
}

/** "-3.20 µm"; a dash while it is not known. */
export function axisPositionLabel(place: AxisPosition, feedback: Feedback | null): string {
  const value = feedback?.joints[place.joint];
  const isKnown = feedback !== null && !feedback.unknown.includes(place.name);
  return value === undefined || !isKnown ? "–" : quantity(value, place.scale);
}
