import type { RecordingEpisodes } from "../episode_list";
import type { Change } from "../episodes_api";
import { button, h, setHidden, setText } from "../../ui/elements/dom";

/** Says what was changed last, and offers to take it back. */
export class UndoBar {
  private readonly words = h("span", "undo-words", { role: "status" });
  private readonly button: HTMLButtonElement;
  readonly element: HTMLElement;
  /** The change that can be taken back. */
  last: { readonly recording: string; readonly number: number } | null = null;

  constructor(undo: () => void) {
    this.button = button("chip-button", "Undo", undo);
    this.element = h("div", "undo-bar", {}, this.words, this.button);
    this.element.hidden = true;
  }

  /** `found`: the recording after the change; `title`: of the episode. */
  offer(found: RecordingEpisodes, change: Change, title: string): void {
    this.last = "undo" in change ? null : { recording: found.id, number: found.revision };
    setText(this.words, `${doneWords(change)}: ${title}`);
    setHidden(this.button, this.last === null);
    setHidden(this.element, false);
  }
}

function doneWords(change: Change): string {
  if ("undo" in change) return `Change ${change.undo} is taken back`;
  if ("dropped" in change) return change.dropped ? "Discarded" : "Restored";
  if ("split" in change) return "Split";
  if ("merge" in change) return "Merged";
  return "first_event" in change ? "Trimmed" : "Saved";
}
