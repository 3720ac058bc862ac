import type { Episode, Outcome } from "../episode_list";
import { OUTCOMES } from "../episode_words";
import type { Change } from "../episodes_api";
import { button, h, setPressed } from "../../ui/elements/dom";

/** An episode's task and outcome, and whether it counts. */
export function labelsForm(episode: Episode, change: (change: Change) => void): HTMLElement {
  const task = h("input", "field", { maxlength: "300", autocomplete: "off" });
  task.value = episode.task;
  let outcome: Outcome = episode.outcome;
  const save = h("button", "field-button", { type: "submit" }, "Save");
  const follow = (): void => {
    for (const [value, each] of choices) setPressed(each, value === outcome);
    const words = task.value.trim();
    save.disabled = words === "" || (words === episode.task && outcome === episode.outcome);
  };
  const choices = OUTCOMES.map(([value, label]) => {
    const choose = button("segment", label, () => {
      outcome = value;
      follow();
    });
    return [value, choose] as const;
  });
  task.addEventListener("input", follow);
  const label = episode.restorable ? "Restore" : "Discard";
  const drop = button("field-button quiet", label, () => {
    change({ episode: episode.id, dropped: !episode.restorable });
  });
  const form = h(
    "form",
    "editor-labels",
    {},
    h("label", "form-field wide", {}, h("span", "form-label", {}, "Task"), task),
    h(
      "div",
      "form-field",
      {},
      h("span", "form-label", {}, "Outcome"),
      h("div", "segments", { role: "group", "aria-label": "Outcome" }, ...choices.map(([, each]) => each)),
    ),
    h("div", "editor-saves", {}, save, drop),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const words = task.value.trim();
    change({
      episode: episode.id,
      ...(words === episode.task ? {} : { task: words }),
      ...(outcome === episode.outcome ? {} : { outcome }),
    });
  });
  follow();
  return h("section", "editor-part", { "aria-label": "Labels" }, form);
}
