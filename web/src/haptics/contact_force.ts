import type { ForceFeeling, RobotDescription } from "../protocol/wire";

/** Size of the force, N. */
export function forceOf(wrench: readonly number[]): number {
  return Math.hypot(wrench[0] ?? 0, wrench[1] ?? 0, wrench[2] ?? 0);
}

/** How this robot's contacts feel; null where nothing measures them. */
export function feelingOf(description: RobotDescription): ForceFeeling | null {
  const { wrench, force_feeling } = description;
  if (wrench === null) return null;
  if (force_feeling !== null) return force_feeling;
  return { threshold_newtons: wrench.threshold_force, full_newtons: wrench.full_scale_force, curve: 1 };
}

/** How strongly a force is felt: 0 up to the threshold, 1 from full on, between them by the curve. */
export function contactStrength(force: number, feeling: ForceFeeling): number {
  const { threshold_newtons: threshold, full_newtons: full, curve } = feeling;
  if (!(force > threshold) || !(full > threshold)) return 0;
  const share = Math.min(1, (force - threshold) / (full - threshold));
  return curve > 0 ? share ** curve : share;
}
