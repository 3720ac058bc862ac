import type { Episode, EpisodeChange, Listed } from "../episode_list";
import { dayLabel } from "../../replay/recording_list";
import { button, h } from "../../ui/elements/dom";

/** What was changed of an episode, the newest first. */
export function changeHistory(
  { recording, episode }: Listed,
  mayEdit: boolean,
  undo: (number: number) => void,
): HTMLElement {
  const mine = recording.changes.filter((each) => concerns(each, episode));
  const element = h("details", "editor-part editor-history", {});
  const count = mine.length === 1 ? "1 change" : `${mine.length} changes`;
  element.append(h("summary", "filter-summary", {}, mine.length === 0 ? "No changes" : count));
  if (recording.trouble !== "") element.append(h("p", "form-trouble", {}, recording.trouble));
  const list = h("ol", "changes");
  for (const each of [...mine].reverse()) list.append(changeRow(each, mayEdit ? undo : null));
  element.append(list);
  element.open = mine.length > 0;
  element.hidden = mine.length === 0 && recording.trouble === "";
  return element;
}

/** `undo`: null for those who may not. */
function changeRow(each: EpisodeChange, undo: ((number: number) => void) | null): HTMLElement {
  const state = each.undone ? " (taken back)" : each.problem === "" ? "" : ` (no effect: ${each.problem})`;
  const who = [each.by, dayLabel(each.at * 1e6)].filter(Boolean).join(", ");
  const row = h(
    "li",
    "change",
    {},
    h("span", "change-words", {}, `${each.number}. ${each.text}${state}`),
    h("span", "muted", {}, who),
  );
  if (undo !== null && !each.undone && each.problem === "" && each.kind !== "undo") {
    const take = button("chip-button", "Undo", () => undo(each.number));
    take.setAttribute("aria-label", `Undo change ${each.number}`);
    row.append(take);
  }
  return row;
}

function concerns(change: EpisodeChange, episode: Episode): boolean {
  const made = /^edit-(\d+)/.exec(episode.id)?.[1];
  return (
    change.episode === episode.id || episode.madeOf.includes(change.episode) || String(change.number) === made
  );
}
