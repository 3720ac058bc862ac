import type { Status, StatusItem } from "../protocol/wire";
import type { Tone } from "./action_labels";

/** A status item as it is shown now. */
export interface ShownItem {
  readonly name: string;
  readonly label: string;
  readonly value: string; // "87 %"
  readonly tone: Tone; // off: the reading is old
  readonly detail: string; // why, and how old it is
}

/** What is wrong comes first: a row may be longer than there is room. */
const WORST: readonly Tone[] = ["bad", "wait", "off", "good"];

/**
 * `sinceMs`: since the status arrived, on this page's own clock; no clock is compared with another. `isSilent`: nothing
 * comes from the robot any more, so that every reading is old, however new it was.
 */
export function shownItems(status: Status | null, sinceMs: number, isSilent: boolean): ShownItem[] {
  const shown = (status?.items ?? []).map((item) => {
    const age = item.age + Math.max(0, sinceMs) / 1000;
    const isOld = isSilent || age >= item.old_after;
    const words = [item.text, isOld ? `old: ${ageWords(age)}` : ""].filter((each) => each !== "");
    return {
      name: item.name,
      label: item.label,
      value: valueWords(item),
      tone: isOld ? "off" : toneOf(item),
      detail: words.join(" · "),
    };
  });
  return shown.sort((left, right) => WORST.indexOf(left.tone) - WORST.indexOf(right.tone));
}

function toneOf(item: StatusItem): Tone {
  return item.level === "ok" ? "good" : item.level === "warning" ? "wait" : "bad";
}

export function valueWords(item: StatusItem): string {
  const { kind, value, unit } = item;
  if (kind === "hardware_stop") return value === true ? "pressed" : "released";
  if (typeof value === "boolean") return value ? "on" : "off";
  if (typeof value === "string") return value;
  if (kind === "battery") return `${Math.round(value * 100)} %`;
  const digits = Math.abs(value) >= 100 ? 0 : Math.abs(value) >= 1 ? 1 : 3;
  return `${Number(value.toFixed(digits))}${unit === "" ? "" : ` ${unit}`}`;
}

function ageWords(seconds: number): string {
  return seconds < 90 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
}
