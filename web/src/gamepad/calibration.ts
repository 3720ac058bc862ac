import {
  ACTIONS,
  CROSS,
  isSameSource,
  STICKS,
  TRIGGERS,
  type CrossName,
  type PadAction,
  type PadLayout,
  type PressSource,
  type StickName,
  type StickSource,
  type TriggerName,
} from "./layout";
import type { PadSnapshot } from "./mapping";

/** One question to the pad's user. */
export interface CalibrationStep {
  readonly name: StickName | TriggerName | CrossName | PadAction;
  readonly kind: "stick" | "press";
  readonly required: boolean;
}

const step = (
  name: CalibrationStep["name"],
  kind: CalibrationStep["kind"],
  required = false,
): CalibrationStep => ({ name, kind, required });

/** What may move or stop the robot comes first and has to be there. */
export const CALIBRATION_STEPS: readonly CalibrationStep[] = [
  step("deadman", "press", true),
  step("arm", "press", true),
  step("stop", "press", true),
  ...STICKS.map((name) => step(name, "stick", name.startsWith("left"))),
  ...TRIGGERS.map((name) => step(name, "press")),
  ...CROSS.map((name) => step(name, "press")),
  step("slow", "press"),
  step("turbo", "press"),
  step("layer", "press"),
  step("action_1", "press"),
  step("action_2", "press"),
  step("episode", "press"),
];

/** letting_go: it waits until nothing moves. asking: it waits for the answer. done: every question was asked. */
export type CalibrationPhase = "letting_go" | "asking" | "done";

interface AxisTrack {
  readonly base: number;
  least: number;
  most: number;
  firstSide: number; // sign of the first clear move, 0 before it
}

export interface Calibration {
  at: number; // index of the step
  phase: CalibrationPhase;
  taken: string | null; // the name of what the last answer already belongs to
  readonly answers: Map<CalibrationStep["name"], StickSource | PressSource | null>; // null: skipped
  last: readonly number[]; // of the newest snapshot: axes, then buttons
  quietSinceMs: number; // nothing has moved since
  tracks: AxisTrack[];
  pressed: number | null; // button pressed since the question was asked
  readonly heldAtStart: Set<number>; // buttons that a pad reports as pressed all the time
}

const QUIET_MS = 250;
const TREMOR = 0.04; // raw; sticks are never quite still
const CLEAR = 0.5; // raw; a move smaller than this is no answer
const BACK = 0.25; // raw, as far from where it began counts as let go
const HAT_AWAY = 1.05; // raw; a hat switch that is let go reads what no place of it does

export function createCalibration(): Calibration {
  return {
    at: 0,
    phase: "letting_go",
    taken: null,
    answers: new Map(),
    last: [],
    quietSinceMs: Infinity,
    tracks: [],
    pressed: null,
    heldAtStart: new Set(),
  };
}

export function currentStep(calibration: Calibration): CalibrationStep | null {
  return CALIBRATION_STEPS[calibration.at] ?? null;
}

/** Takes what the pad says now. */
export function observe(calibration: Calibration, pad: PadSnapshot, now: number): void {
  const isQuiet = noteQuiet(calibration, pad, now);
  const asked = currentStep(calibration);
  if (asked === null) return;
  if (calibration.phase === "letting_go") {
    if (isQuiet) begin(calibration, pad);
    return;
  }
  track(calibration, pad);
  const answer =
    asked.kind === "stick"
      ? stickAnswer(calibration, pad, asked)
      : isQuiet
        ? pressAnswer(calibration, pad, asked)
        : null;
  if (answer !== null) take(calibration, asked, answer);
}

/** Goes on without this one; says whether it may be missing. */
export function skip(calibration: Calibration): boolean {
  const asked = currentStep(calibration);
  if (asked === null || asked.required) return false;
  calibration.answers.set(asked.name, null);
  goTo(calibration, calibration.at + 1);
  return true;
}

/** Asks the question before this one again. */
export function goBack(calibration: Calibration): void {
  goTo(calibration, Math.max(0, calibration.at - 1));
  const asked = currentStep(calibration);
  if (asked !== null) calibration.answers.delete(asked.name);
}

/** What the answers make; null before the last question is answered. */
export function layoutOf(calibration: Calibration): PadLayout | null {
  if (calibration.phase !== "done") return null;
  const stick = (name: StickName): StickSource | null => {
    const found = calibration.answers.get(name) ?? null;
    return found !== null && "positive" in found ? found : null;
  };
  const press = (name: TriggerName | CrossName | PadAction): PressSource | null => {
    const found = calibration.answers.get(name) ?? null;
    return found !== null && "kind" in found ? found : null;
  };
  const presses = (name: PadAction): PressSource[] => [press(name)].filter((source) => source !== null);
  const [deadman, arm, stop] = [presses("deadman"), presses("arm"), presses("stop")];
  return {
    sticks: {
      left_x: stick("left_x"),
      left_y: stick("left_y"),
      right_x: stick("right_x"),
      right_y: stick("right_y"),
    },
    triggers: { left_trigger: press("left_trigger"), right_trigger: press("right_trigger") },
    cross: {
      cross_up: press("cross_up"),
      cross_right: press("cross_right"),
      cross_down: press("cross_down"),
      cross_left: press("cross_left"),
    },
    actions: {
      ...{ deadman, arm, stop },
      slow: presses("slow"),
      turbo: presses("turbo"),
      layer: presses("layer"),
      action_1: presses("action_1"),
      action_2: presses("action_2"),
      episode: presses("episode"),
    },
  };
}

function goTo(calibration: Calibration, at: number): void {
  calibration.at = at;
  calibration.taken = null;
  letGo(calibration);
  if (at >= CALIBRATION_STEPS.length) calibration.phase = "done";
}

function letGo(calibration: Calibration): void {
  calibration.phase = "letting_go";
  calibration.quietSinceMs = Infinity;
  calibration.pressed = null;
}

/** Whether nothing has moved for a moment. */
function noteQuiet(calibration: Calibration, pad: PadSnapshot, now: number): boolean {
  const axes = pad.axes.map((raw) => (Number.isFinite(raw) ? raw : 0));
  const values = [...axes, ...pad.buttons.map((button) => Number(button.pressed))];
  const { last } = calibration;
  const hasMoved =
    values.length !== last.length ||
    values.some((value, at) => !(Math.abs(value - (last[at] ?? 0)) <= TREMOR));
  if (hasMoved) calibration.last = values;
  if (hasMoved || calibration.quietSinceMs === Infinity) calibration.quietSinceMs = now;
  return now - calibration.quietSinceMs >= QUIET_MS;
}

function begin(calibration: Calibration, pad: PadSnapshot): void {
  calibration.phase = "asking";
  calibration.tracks = pad.axes.map((base) => ({ base, least: base, most: base, firstSide: 0 }));
  calibration.heldAtStart.clear();
  for (const [index, button] of pad.buttons.entries()) if (button.pressed) calibration.heldAtStart.add(index);
}

function track(calibration: Calibration, pad: PadSnapshot): void {
  for (const [index, raw] of pad.axes.entries()) {
    const axis = calibration.tracks[index];
    if (axis === undefined || !Number.isFinite(raw)) continue;
    axis.least = Math.min(axis.least, raw);
    axis.most = Math.max(axis.most, raw);
    if (axis.firstSide === 0 && Math.abs(raw - axis.base) >= CLEAR)
      axis.firstSide = Math.sign(raw - axis.base);
  }
  for (const [index, button] of pad.buttons.entries())
    if (button.pressed && !calibration.heldAtStart.has(index)) calibration.pressed ??= index;
}

/** An axis that went clearly to both sides and came back. Right and up are asked for first. */
function stickAnswer(calibration: Calibration, pad: PadSnapshot, asked: CalibrationStep): StickSource | null {
  const upIsFirst = asked.name.endsWith("_y") ? -1 : 1;
  const answers = calibration.tracks.flatMap((axis, index) => {
    const isBack = Math.abs((pad.axes[index] ?? Infinity) - axis.base) <= BACK;
    if (!wentBoth(axis) || !isBack) return [];
    const isPositive = axis.firstSide * upIsFirst > 0;
    const [positive, negative] = isPositive ? [axis.most, axis.least] : [axis.least, axis.most];
    return [{ index, negative, rest: axis.base, positive }];
  });
  return preferFree(calibration, answers, ({ positive, negative }) => Math.abs(positive - negative));
}

/**
 * Judged once all is let go and still. An axis comes before a button, because triggers often are both and the axis says
 * more. Where it rests is where it went back to: before its first touch it may have read something else.
 */
function pressAnswer(calibration: Calibration, pad: PadSnapshot, asked: CalibrationStep): PressSource | null {
  const isHeld = [...pad.buttons.entries()].some(
    ([index, button]) => button.pressed && !calibration.heldAtStart.has(index),
  );
  if (isHeld) return null;
  const answers = calibration.tracks.flatMap((axis, index) => {
    const rest = pad.axes[index] ?? axis.base;
    const source = axisPress(axis, index, rest);
    // A stick is no button: it would be held by leaning on it.
    return source === null || (isAction(asked.name) && Math.abs(rest) < CLEAR) ? [] : [source];
  });
  const best = preferFree(calibration, answers, (source) =>
    source.kind === "axis" ? Math.abs(source.full - source.rest) : 2,
  );
  if (best !== null) return best;
  return calibration.pressed === null ? null : { kind: "button", index: calibration.pressed };
}

/** What a press of an axis that now lies still at `rest` was; null when it was not pressed, or is held. */
function axisPress(axis: AxisTrack, index: number, rest: number): PressSource | null {
  const full = axis.most - rest > rest - axis.least ? axis.most : axis.least;
  // Left its place and stayed: a trigger that read 0 before its first touch, woken by another part, or one that is held.
  if (!(Math.abs(full - rest) >= CLEAR && Math.abs(full - axis.base) >= CLEAR)) return null;
  if (Math.abs(rest) > HAT_AWAY) return { kind: "hat", index, value: full };
  // Pulled from that 0 it goes to both sides; where it rests is the lower one, else it is still held.
  if (wentBoth(axis) && rest - axis.least > BACK && Math.abs(rest - axis.base) > BACK) return null;
  return { kind: "axis", index, rest, full };
}

function wentBoth(axis: AxisTrack): boolean {
  return axis.base - axis.least >= CLEAR && axis.most - axis.base >= CLEAR;
}

function isAction(name: CalibrationStep["name"]): boolean {
  return (ACTIONS as readonly string[]).includes(name);
}

/** The answer with the longest way of those that belong to nothing yet, else of all. */
function preferFree<T extends StickSource | PressSource>(
  calibration: Calibration,
  answers: readonly T[],
  reach: (answer: T) => number,
): T | null {
  const free = answers.filter((answer) => ownerOf(calibration, answer) === null);
  const [best] = [...(free.length > 0 ? free : answers)].sort((left, right) => reach(right) - reach(left));
  return best ?? null;
}

function take(calibration: Calibration, asked: CalibrationStep, answer: StickSource | PressSource): void {
  const taken = ownerOf(calibration, answer);
  if (taken !== null) {
    calibration.taken = taken;
    letGo(calibration);
    return;
  }
  calibration.answers.set(asked.name, answer);
  goTo(calibration, calibration.at + 1);
}

/** What the same part of the pad was already given to. */
function ownerOf(calibration: Calibration, answer: StickSource | PressSource): string | null {
  for (const [name, given] of calibration.answers) {
    if (given === null) continue;
    const bothPress = "kind" in given && "kind" in answer;
    if (bothPress ? isSameSource(given, answer) : shareAxis(given, answer)) return name;
  }
  return null;
}

function shareAxis(left: StickSource | PressSource, right: StickSource | PressSource): boolean {
  const isAxis = (source: StickSource | PressSource): boolean =>
    !("kind" in source) || source.kind !== "button";
  return isAxis(left) && isAxis(right) && left.index === right.index;
}
