import type { Axis, RobotDescription } from "../../protocol/wire";

/** The refusal of a goal, so that the page can say what to do next. */
export interface GoalRefusal {
  readonly reason: "conflict" | "jump";
  readonly detail: string; // "arm.elbow: 0.7 rad from where it is; its reach is 0.5"
  readonly atMs: number;
}

/** A refusal repeats while its cause lasts: so long after the newest one the page still shows it. */
const SHOWN_MS = 2500;

/** A refusal that is to be shown now; null: none. */
export function shownRefusal(refusal: GoalRefusal | null, now: number): GoalRefusal | null {
  return refusal !== null && now - refusal.atMs < SHOWN_MS ? refusal : null;
}

/** The axis that a refusal names; null: none, or none of this robot. */
export function refusedAxis(refusal: GoalRefusal, description: RobotDescription | null): Axis | null {
  return description?.axes.find((axis) => refusal.detail.startsWith(`${axis.name}:`)) ?? null;
}

/** Says what was refused and what to do next. */
export function goalRefusalWords(refusal: GoalRefusal, description: RobotDescription | null): string {
  if (refusal.reason === "conflict")
    return "Refused: two controls move the same joints. Let go of one, or change the layer";
  const axis = refusedAxis(refusal, description);
  const who = axis === null ? "A joint" : axis.label;
  return `Refused: ${who} is too far from its goal. Let go and begin again; if something holds it, STOP and reset`;
}
