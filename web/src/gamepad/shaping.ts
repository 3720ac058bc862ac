import { DEFAULT_SHAPING, type PadShaping } from "./stick_shape";

/** What each setting may be. Above a deadzone of a half no stick is left to steer with. */
export const SHAPING_BOUNDS: Readonly<Record<keyof PadShaping, readonly [least: number, most: number]>> = {
  deadzone: [0, 0.5],
  expo: [0, 1],
  slow: [0.02, 1],
  normal: [0.05, 1],
  turbo: [0.05, 1],
};

/** Share of the axes' limits that the sticks may ask for. Slow wins over turbo: who holds both wants care. */
export function speedShare(shaping: PadShaping, slow: boolean, turbo: boolean): number {
  if (slow) return Math.min(1, shaping.slow);
  return Math.min(1, turbo ? Math.max(shaping.turbo, shaping.normal) : shaping.normal);
}

/** The settings, each within its bounds; what is no number takes its default. */
export function boundedShaping(wanted: Readonly<Partial<Record<keyof PadShaping, unknown>>>): PadShaping {
  const bounded = (name: keyof PadShaping): number => {
    const value = wanted[name];
    const [least, most] = SHAPING_BOUNDS[name];
    if (typeof value !== "number" || !Number.isFinite(value)) return DEFAULT_SHAPING[name];
    return Math.min(most, Math.max(least, value));
  };
  return {
    deadzone: bounded("deadzone"),
    expo: bounded("expo"),
    slow: bounded("slow"),
    normal: bounded("normal"),
    turbo: bounded("turbo"),
  };
}
