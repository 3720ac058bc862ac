import type { Feedback } from "../../protocol/wire";

/** Whole seconds that the robot still warns before it may move, counted on between two feedbacks; 0: it does not. */
export function warningSeconds(feedback: Feedback | null, measuredMs: number | null, now: number): number {
  if (feedback === null || measuredMs === null || feedback.warning <= 0) return 0;
  return Math.max(0, Math.ceil(feedback.warning - (now - measuredMs) / 1000));
}

export function warningLabel(seconds: number): string {
  return `The robot warns the people near it: it may move in ${seconds} s`;
}
