/** How a pad's sticks and modifier buttons become speed. Shares are of the axes' limits and never above 1. */
export interface PadShaping {
  readonly deadzone: number; // 0 to 0.5 of the travel around the middle does nothing
  readonly expo: number; // 0 to 1, share of the cubic part: fine near the middle, full at the end
  readonly slow: number; // share of full speed while the slow button is held
  readonly normal: number; // without a modifier
  readonly turbo: number; // while the turbo button is held
}

export const DEFAULT_SHAPING: PadShaping = { deadzone: 0.12, expo: 0.35, slow: 0.3, normal: 1, turbo: 1 };

/** A stick value without its play around the middle, from -1 to 1. */
export function shapeStick(value: number, shaping: PadShaping = DEFAULT_SHAPING): number {
  const { deadzone, expo } = shaping;
  const size = Math.min(1, Math.abs(value));
  if (!(size > deadzone)) return 0;
  const travel = (size - deadzone) / (1 - deadzone);
  return Math.sign(value) * ((1 - expo) * travel + expo * travel ** 3);
}
