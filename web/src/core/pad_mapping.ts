import type { Binding } from "../wire";

export type PadInput = NonNullable<Binding["pad"]>;

/** What is read of a gamepad; the browser's Gamepad fits it. */
export interface PadSnapshot {
  readonly mapping: string; // "standard", or "" for a pad that the browser does not know
  readonly axes: readonly number[];
  readonly buttons: readonly { readonly pressed: boolean; readonly value: number }[];
}

export type PadInputs = Readonly<Record<PadInput, number>>;

/** Buttons of the W3C standard mapping, by what they do here. */
export const PAD_BUTTONS = { stop: [1, 8], layer: 3, slow: 4, deadman: 5, arm: 9 } as const;

const DEADZONE = 0.12;
const EXPO = 0.35; // share of the cubic part: fine near the middle, full at the end

/** A stick value without its play around the middle, from -1 to 1. */
export function shapeStick(value: number): number {
  const size = Math.min(1, Math.abs(value));
  if (!(size > DEADZONE)) return 0;
  const travel = (size - DEADZONE) / (1 - DEADZONE);
  return Math.sign(value) * ((1 - EXPO) * travel + EXPO * travel ** 3);
}

/** The inputs that bindings name; left and up are negative, as the standard mapping has them. */
export function readPad(pad: PadSnapshot): PadInputs {
  return {
    left_x: shapeStick(pad.axes[0] ?? 0),
    left_y: shapeStick(pad.axes[1] ?? 0),
    right_x: shapeStick(pad.axes[2] ?? 0),
    right_y: shapeStick(pad.axes[3] ?? 0),
    dpad_x: pressure(pad, 15) - pressure(pad, 14),
    dpad_y: pressure(pad, 13) - pressure(pad, 12),
    triggers: shapeStick(pressure(pad, 7) - pressure(pad, 6)),
  };
}

export function isPressed(pad: PadSnapshot, button: number): boolean {
  return pad.buttons[button]?.pressed ?? false;
}

/** Only the standard mapping says which button is which, so no other pad may drive. */
export function isStandard(pad: PadSnapshot): boolean {
  return pad.mapping === "standard";
}

function pressure(pad: PadSnapshot, button: number): number {
  const found = pad.buttons[button];
  if (found === undefined) return 0;
  return found.pressed && found.value === 0 ? 1 : found.value;
}
