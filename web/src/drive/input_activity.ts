import type { HeldInputs } from "./axis_mapping";

/** Sticks tremble by themselves; a change smaller than this is no sign of a hand. Share of the full travel. */
const TREMOR = 0.03;

/** A slider that is held does not tremble: it counts from its first pixel. */
const SLIDER_GAIN = 100;

/** What is held, compared with what was held when it last changed: a deadman that is taped down changes nothing. */
export interface InputActivity {
  keys: string; // pressed
  values: readonly number[]; // of pad, touch and sliders
  changes: number;
}

export function createInputActivity(): InputActivity {
  return { keys: "", values: [], changes: 0 };
}

/** Takes what is held now; returns a text that stays the same while no hand shows. */
export function noteInput(activity: InputActivity, held: HeldInputs): string {
  const keys = [...held.keys].sort().join();
  const travels = valuesOf(held.sliders?.travels ?? null).map((travel) => SLIDER_GAIN * travel);
  const values = [...valuesOf(held.pad), ...valuesOf(held.touch), ...travels];
  if (keys !== activity.keys || isMoved(values, activity.values)) {
    activity.keys = keys;
    activity.values = values;
    activity.changes += 1;
  }
  return String(activity.changes);
}

function valuesOf(inputs: Readonly<Record<string, number>> | null): number[] {
  return inputs === null ? [] : Object.values(inputs);
}

function isMoved(values: readonly number[], before: readonly number[]): boolean {
  return (
    values.length !== before.length ||
    values.some((value, at) => Math.abs(value - (before[at] ?? 0)) > TREMOR)
  );
}
