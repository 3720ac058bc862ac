import type { WrenchSensor } from "../wire";

/** Size of the force, N. */
export function forceOf(wrench: readonly number[]): number {
  return Math.hypot(wrench[0] ?? 0, wrench[1] ?? 0, wrench[2] ?? 0);
}

/** How strongly a force is felt: 0 up to the threshold, 1 from full scale on. */
export function contactStrength(force: number, sensor: WrenchSensor): number {
  const span = sensor.full_scale_force - sensor.threshold_force;
  if (!(force > sensor.threshold_force) || !(span > 0)) return 0;
  return Math.min(1, (force - sensor.threshold_force) / span);
}
