/** Lets the pad rumble with the contact force. */
const EFFECT_MS = 140;
const REPEAT_MS = 90;

export class Rumble {
  private lastMs = -Infinity;
  private actuator: GamepadHapticActuator | null = null;

  /** `strength`: 0 to 1. `gamepad` is null when nothing may be felt. */
  feel(gamepad: Gamepad | null, strength: number, now: number): void {
    const actuator = gamepad?.vibrationActuator ?? null;
    if (actuator === null || strength <= 0) {
      this.stop();
      return;
    }
    if (now - this.lastMs < REPEAT_MS) return;
    this.lastMs = now;
    this.actuator = actuator;
    const effect = {
      duration: EFFECT_MS,
      strongMagnitude: strength,
      weakMagnitude: Math.min(1, 0.25 + strength),
    };
    // A pad may refuse an effect it does not have, or be preempted by the next one.
    actuator.playEffect("dual-rumble", effect).catch(() => undefined);
  }

  stop(): void {
    if (this.actuator === null) return;
    this.actuator.reset().catch(() => undefined);
    this.actuator = null;
    this.lastMs = -Infinity;
  }
}
