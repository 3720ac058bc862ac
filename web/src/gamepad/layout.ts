/** Which part of a pad does what. The W3C standard mapping is one layout; calibration makes others. */

export const STICKS = ["left_x", "left_y", "right_x", "right_y"] as const;
export const TRIGGERS = ["left_trigger", "right_trigger"] as const;
export const CROSS = ["cross_up", "cross_right", "cross_down", "cross_left"] as const;
export const ACTIONS = [
  "deadman",
  "arm",
  "stop",
  "slow",
  "turbo",
  "layer",
  "action_1",
  "action_2",
  "episode",
] as const;

export type StickName = (typeof STICKS)[number];
export type TriggerName = (typeof TRIGGERS)[number];
export type CrossName = (typeof CROSS)[number];
export type PadAction = (typeof ACTIONS)[number];

/** An axis with two directions; raw values. Left and up are negative, whatever the pad itself says. */
export interface StickSource {
  readonly index: number;
  readonly negative: number;
  readonly rest: number;
  readonly positive: number;
}

/** Something with one direction, 0 when let go and 1 at its end. */
export type PressSource =
  | { readonly kind: "button"; readonly index: number }
  | { readonly kind: "axis"; readonly index: number; readonly rest: number; readonly full: number }
  | { readonly kind: "hat"; readonly index: number; readonly value: number }; // one of the places of a hat switch

export interface PadLayout {
  readonly sticks: Readonly<Record<StickName, StickSource | null>>;
  readonly triggers: Readonly<Record<TriggerName, PressSource | null>>;
  readonly cross: Readonly<Record<CrossName, PressSource | null>>;
  readonly actions: Readonly<Record<PadAction, readonly PressSource[]>>;
}

const button = (index: number): PressSource => ({ kind: "button", index });
const stick = (index: number): StickSource => ({ index, negative: -1, rest: 0, positive: 1 });

/** https://www.w3.org/TR/gamepad/#remapping */
export const STANDARD_LAYOUT: PadLayout = {
  sticks: { left_x: stick(0), left_y: stick(1), right_x: stick(2), right_y: stick(3) },
  triggers: { left_trigger: button(6), right_trigger: button(7) },
  cross: { cross_up: button(12), cross_right: button(15), cross_down: button(13), cross_left: button(14) },
  actions: {
    deadman: [button(5)],
    arm: [button(9)],
    stop: [button(1), button(8)],
    slow: [button(4)],
    turbo: [button(10)],
    layer: [button(3)],
    action_1: [button(0)],
    action_2: [button(2)],
    episode: [button(11)],
  },
};

/** Whether two sources are the same part of the pad. Two places of one hat are not. */
export function isSameSource(left: PressSource, right: PressSource): boolean {
  if (left.kind !== right.kind || left.index !== right.index) return false;
  if (left.kind === "button" || right.kind === "button") return true;
  if (left.kind === "axis" && right.kind === "axis")
    return Math.sign(left.full - left.rest) === Math.sign(right.full - right.rest);
  return left.kind === "hat" && right.kind === "hat" && Math.abs(left.value - right.value) < 0.1;
}
