import { REFUSAL_LABELS } from "../session/refusal_labels";
import type { MarkKind, ReplayMark } from "./index_table";

/** What marks are gathered under: what somebody looks for. */
export type MarkGroup = "contacts" | "refusals" | "stops" | "seats" | "episodes" | "others";

export const MARK_GROUPS: readonly MarkGroup[] = [
  "contacts",
  "refusals",
  "stops",
  "seats",
  "episodes",
  "others",
];

export const GROUP_NAMES: Readonly<Record<MarkGroup, string>> = {
  contacts: "Contacts",
  refusals: "Refusals",
  stops: "Stops",
  seats: "Hand-overs",
  episodes: "Episodes",
  others: "Other",
};

const GROUPS: Readonly<Record<MarkKind, MarkGroup>> = {
  contact: "contacts",
  refusal: "refusals",
  stop: "stops",
  reset: "stops",
  seat: "seats",
  note: "others",
  fault: "others",
  link: "others",
  action: "others",
  episode: "episodes",
};

const NAMES: Readonly<Record<MarkKind, string>> = {
  contact: "Contact",
  refusal: "Refusal",
  stop: "Stop",
  reset: "Reset",
  seat: "Control seat",
  note: "Note",
  fault: "Fault",
  link: "Robot link",
  action: "Action",
  episode: "Episode",
};

export function groupOf(mark: ReplayMark): MarkGroup {
  return GROUPS[mark.kind];
}

export function markName(mark: ReplayMark): string {
  return NAMES[mark.kind];
}

/** A refusal's reason in words; everything else as it was recorded. */
export function markLabel(mark: ReplayMark): string {
  if (mark.kind !== "refusal") return mark.text;
  const [reason = "", ...name] = mark.text.split(" ");
  const words = Object.entries(REFUSAL_LABELS).find(([known]) => known === reason)?.[1];
  if (words === undefined) return mark.text;
  return name.length === 0 ? words : `${name.join(" ")}: ${words}`;
}

/** How many there are of each group. */
export function countMarks(marks: readonly ReplayMark[]): Record<MarkGroup, number> {
  const counts = { contacts: 0, refusals: 0, stops: 0, seats: 0, episodes: 0, others: 0 };
  for (const mark of marks) counts[groupOf(mark)]++;
  return counts;
}
