/** How a pad's sticks and modifier buttons become speed. Shares are of the axes' limits and never above 1. */
export interface PadShaping {
  readonly deadzone: number; // 0 to 0.5 of the travel around the middle does nothing
  readonly expo: number; // 0 to 1, share of the cubic part: fine near the middle, full at the end
  readonly slow: number; // share of full speed while the slow button is held
  readonly normal: number; // without a modifier
  readonly turbo: number; // while the turbo button is held
}

export const DEFAULT_SHAPING: PadShaping = { deadzone: 0.12, expo: 0.35, slow: 0.3, normal: 1, turbo: 1 };

/** What each setting may be. Above a deadzone of a half no stick is left to steer with. */
export const SHAPING_BOUNDS: Readonly<Record<keyof PadShaping, readonly [least: number, most: number]>> = {
  deadzone: [0, 0.5],
  expo: [0, 1],
  slow: [0.02, 1],
  normal: [0.05, 1],
  turbo: [0.05, 1],
};

/** A stick value without its play around the middle, from -1 to 1. */
export function shapeStick(value: number, shaping: PadShaping = DEFAULT_SHAPING): number {
  const { deadzone, expo } = shaping;
  const size = Math.min(1, Math.abs(value));
  if (!(size > deadzone)) return 0;
  const travel = (size - deadzone) / (1 - deadzone);
  return Math.sign(value) * ((1 - expo) * travel + expo * travel ** 3);
}

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
