/** One effect, of the kind that GamepadHapticActuator.playEffect takes. It ends by itself, whatever becomes of the page. */
export interface RumbleEffect {
  readonly duration: number; // ms
  readonly strongMagnitude: number;
  readonly weakMagnitude: number;
  readonly leftTrigger: number;
  readonly rightTrigger: number;
}

export type RumbleOrder =
  | { readonly kind: "play"; readonly effect: RumbleEffect }
  | { readonly kind: "stop" }
  | { readonly kind: "keep" };

/** What the pad was told last. */
export interface RumblePlan {
  strength: number; // 0 when it lies still
  playedMs: number;
}

const EFFECT_MS = 160;
const REPEAT_MS = 90; // before the last effect has ended
const JUMP = 0.15; // a change of strength that is told at once
const TOUCH = 0.3; // weak motors do not turn below this
const KNOCK = 0.55; // the first touch is a knock, however light

const KEEP: RumbleOrder = { kind: "keep" };

export function createRumblePlan(): RumblePlan {
  return { strength: 0, playedMs: -Infinity };
}

/** What to tell the pad now that a contact of this strength (0 to 1) is felt. */
export function planRumble(plan: RumblePlan, strength: number, now: number): RumbleOrder {
  if (!(strength > 0)) return stopRumble(plan);
  const isTouch = plan.strength === 0;
  const hasJumped = Math.abs(strength - plan.strength) >= JUMP;
  if (!isTouch && !hasJumped && now - plan.playedMs < REPEAT_MS) return KEEP;
  plan.strength = strength;
  plan.playedMs = now;
  const weak = Math.max(isTouch ? KNOCK : TOUCH, strength);
  return {
    kind: "play",
    effect: {
      duration: EFFECT_MS,
      strongMagnitude: isTouch ? Math.max(KNOCK, strength) : strength,
      weakMagnitude: Math.min(1, weak),
      leftTrigger: strength,
      rightTrigger: strength,
    },
  };
}

/** Nothing may be felt any more. */
export function stopRumble(plan: RumblePlan): RumbleOrder {
  if (plan.strength === 0) return KEEP;
  plan.strength = 0;
  plan.playedMs = -Infinity;
  return { kind: "stop" };
}
