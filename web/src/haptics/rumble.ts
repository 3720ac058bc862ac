import { createRumblePlan, planRumble, stopRumble, type RumbleEffect, type RumbleOrder } from "./rumble_plan";

/** Lets one pad at a time rumble with the contact force: its triggers too where it has motors in them. */
export class Rumble {
  private plan = createRumblePlan();
  private pad: {
    readonly index: number;
    readonly id: string;
    readonly actuator: GamepadHapticActuator;
  } | null = null;

  /** `strength`: 0 to 1. `gamepad` is null when nothing may be felt. */
  feel(gamepad: Gamepad | null, strength: number, now: number): void {
    const actuator = gamepad === null ? null : actuatorOf(gamepad);
    if (gamepad === null || actuator === null) {
      this.stop();
      return;
    }
    if (
      this.pad !== null &&
      (this.pad.index !== gamepad.index ||
        this.pad.id !== gamepad.id ||
        (gamepad.index < 0 && this.pad.actuator !== actuator))
    )
      this.stop();
    this.pad = { index: gamepad.index, id: gamepad.id, actuator };
    this.carryOut(planRumble(this.plan, strength, now));
  }

  stop(): void {
    this.carryOut(stopRumble(this.plan));
    this.pad = null;
  }

  private carryOut(order: RumbleOrder): void {
    if (this.pad === null || order.kind === "keep") return;
    const { actuator } = this.pad;
    // A pad that is gone, or lacks the effect, refuses it; one that is preempted by the next says so.
    const done = order.kind === "play" ? play(actuator, order.effect) : reset(actuator);
    done.catch(() => undefined);
  }
}

/** What browsers with the older interface have instead. */
interface PulseActuator {
  readonly pulse?: (value: number, duration: number) => Promise<boolean>;
}

function actuatorOf(gamepad: Gamepad): GamepadHapticActuator | null {
  const { vibrationActuator, hapticActuators } = gamepad as {
    vibrationActuator?: GamepadHapticActuator | null;
    hapticActuators?: readonly GamepadHapticActuator[];
  };
  return vibrationActuator ?? hapticActuators?.[0] ?? null;
}

function play(actuator: GamepadHapticActuator | PulseActuator, effect: RumbleEffect): Promise<unknown> {
  if (!("playEffect" in actuator))
    return actuator.pulse?.(effect.weakMagnitude, effect.duration) ?? Promise.resolve();
  const effects = (actuator as { effects?: readonly string[] }).effects ?? [];
  const kind = effects.includes("trigger-rumble") ? "trigger-rumble" : "dual-rumble";
  return actuator.playEffect(kind, effect);
}

function reset(actuator: GamepadHapticActuator | PulseActuator): Promise<unknown> {
  if ("reset" in actuator) return actuator.reset();
  return actuator.pulse?.(0, 0) ?? Promise.resolve();
}
