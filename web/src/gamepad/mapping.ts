import type { Binding } from "../protocol/wire";
import {
  ACTIONS,
  CROSS,
  STICKS,
  TRIGGERS,
  type PadAction,
  type PadLayout,
  type PressSource,
  type StickSource,
} from "./layout";
import { shapeStick, type PadShaping } from "./stick_shape";

export type PadInput = NonNullable<Binding["pad"]>;

/** What is read of a gamepad; the browser's Gamepad fits it. */
export interface PadSnapshot {
  readonly id: string;
  readonly mapping: string; // "standard", or "" for a pad that the browser does not know
  readonly axes: readonly number[];
  readonly buttons: readonly { readonly pressed: boolean; readonly value: number }[];
}

export type PadInputs = Readonly<Record<PadInput, number>>;

/** What a pad says at one moment. */
export interface PadReading {
  readonly inputs: PadInputs; // shaped
  readonly pressed: ReadonlySet<PadAction>;
}

/**
 * Sources that were seen let go since the pad came. An axis that rests at -1 reads 0 until it is touched first:
 * half pressed. So an axis with one direction counts only from when it was seen at rest.
 */
export type SeenAtRest = Set<string>;

const PRESSED = 0.5; // of the travel
const AT_REST = 0.15;
const HAT_TURN = 16 / 7; // eight places, 2/7 apart
const HAT_REACH = 0.3; // the diagonals lie 2/7 away and press both neighbours

export function readPad(
  pad: PadSnapshot,
  layout: PadLayout,
  shaping: PadShaping,
  seen: SeenAtRest,
): PadReading {
  const press = (source: PressSource | null): number => (source === null ? 0 : pressure(pad, source, seen));
  const { sticks, triggers, cross } = layout;
  const stick = (source: StickSource | null): number => shapeStick(deflection(pad, source), shaping);
  const inputs: PadInputs = {
    left_x: stick(sticks.left_x),
    left_y: stick(sticks.left_y),
    right_x: stick(sticks.right_x),
    right_y: stick(sticks.right_y),
    dpad_x: press(cross.cross_right) - press(cross.cross_left),
    dpad_y: press(cross.cross_down) - press(cross.cross_up),
    triggers: shapeStick(press(triggers.right_trigger) - press(triggers.left_trigger), shaping),
  };
  const held = ACTIONS.filter((action) => layout.actions[action].some((each) => press(each) >= PRESSED));
  return { inputs, pressed: new Set(held) };
}

/** From -1 to 1 within the calibrated travel; 0 for what the pad does not have. */
export function deflection(pad: PadSnapshot, source: StickSource | null): number {
  const raw = source === null ? undefined : pad.axes[source.index];
  if (source === null || raw === undefined || !Number.isFinite(raw)) return 0;
  const { negative, rest, positive } = source;
  const isPositive = (raw - rest) * (positive - rest) > 0;
  const travel = isPositive ? positive - rest : negative - rest;
  if (travel === 0) return 0;
  const share = Math.min(1, Math.abs((raw - rest) / travel));
  return isPositive ? share : -share;
}

/** From 0 (let go) to 1. */
export function pressure(pad: PadSnapshot, source: PressSource, seen: SeenAtRest): number {
  if (source.kind === "button") return buttonPressure(pad, source.index);
  const raw = pad.axes[source.index];
  if (raw === undefined || !Number.isFinite(raw)) return 0;
  if (source.kind === "hat") return hatDistance(raw, source.value) <= HAT_REACH ? 1 : 0;
  const share = Math.min(1, Math.max(0, (raw - source.rest) / (source.full - source.rest)));
  const name = `${source.index}:${source.rest}`;
  if (share <= AT_REST) seen.add(name);
  return seen.has(name) ? share : 0;
}

/** The parts of the pad that a layout names and the pad does not have. */
export function lacks(pad: PadSnapshot, layout: PadLayout): boolean {
  const has = (source: PressSource): boolean =>
    source.index < (source.kind === "button" ? pad.buttons : pad.axes).length;
  const sticks = STICKS.map((name) => layout.sticks[name]);
  const presses = [
    ...TRIGGERS.map((name) => layout.triggers[name]),
    ...CROSS.map((name) => layout.cross[name]),
    ...ACTIONS.flatMap((name) => layout.actions[name]),
  ];
  return (
    sticks.some((source) => source !== null && source.index >= pad.axes.length) ||
    presses.some((source) => source !== null && !has(source))
  );
}

function buttonPressure(pad: PadSnapshot, index: number): number {
  const found = pad.buttons[index];
  if (found === undefined) return 0;
  return found.pressed && found.value === 0 ? 1 : found.value;
}

/** Round the switch: the last place is the first one's neighbour. */
function hatDistance(value: number, place: number): number {
  if (Math.abs(value) > 1.05) return Infinity; // let go
  const apart = Math.abs(value - place) % HAT_TURN;
  return Math.min(apart, HAT_TURN - apart);
}
