/** A force on the hand, seen from above: shares of the strongest, whose length is at most 1. */
export interface StickForce {
  readonly right: number;
  readonly ahead: number; // away from the operator
}

export const NO_FORCE: StickForce = { right: 0, ahead: 0 };

/**
 * The part of a measured wrench (N, N m) that the hand feels: x pushes ahead, y to the left (REP 103). `strength`: 0 to 1, how
 * strongly a contact of this size is felt. Of a force from above or below the hand feels nothing.
 */
export function stickForce(wrench: readonly number[], strength: number): StickForce {
  const [x = 0, y = 0, z = 0] = wrench;
  const force = Math.hypot(x, y, z);
  if (!(strength > 0) || !(force > 0) || !Number.isFinite(force)) return NO_FORCE;
  const share = Math.min(1, strength) / force;
  return { right: -y * share, ahead: x * share };
}

export function lengthOf({ right, ahead }: StickForce): number {
  return Math.hypot(right, ahead);
}

/** The force on its way from one to another: it grows by no more than `growth`, and shrinks by no more than `fall`. */
export function ramped(from: StickForce, to: StickForce, growth: number, fall: number): StickForce {
  const [right, ahead] = [to.right - from.right, to.ahead - from.ahead];
  const way = Math.hypot(right, ahead);
  const most = lengthOf(to) < lengthOf(from) ? fall : growth;
  if (way <= most) return to;
  return { right: from.right + (right * most) / way, ahead: from.ahead + (ahead * most) / way };
}

/** Where the force comes from, clockwise from ahead, in degrees: PID and DirectInput name a force by its source. */
export function sourceDegrees({ right, ahead }: StickForce): number {
  const degrees = (Math.atan2(-right, -ahead) * 180) / Math.PI;
  return (degrees + 360) % 360;
}
