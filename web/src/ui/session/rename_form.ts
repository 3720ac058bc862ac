import type { ConsoleEngine } from "../../engine/console_engine";
import { button, h, setHidden } from "../elements/dom";

/** The name that others see, changed where it stands. */
export function createRenameForm(engine: ConsoleEngine): HTMLElement {
  const input = h("input", "field", { type: "text", maxlength: "60", "aria-label": "Your name" });
  input.autocomplete = "off";
  const save = h("button", "field-button", { type: "submit" }, "Save");
  const form = h("form", "rename", {}, input, save);
  const start = button("quiet-button", "Change your name", () => {
    input.value =
      engine.state.participants.find((person) => person.peer === engine.state.welcome?.peer)?.name ?? "";
    show(true);
    input.select();
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    engine.session.rename(input.value);
    show(false);
    start.focus();
  });
  input.addEventListener("keydown", (event) => {
    if (event.code === "Escape") show(false);
  });
  const show = (editing: boolean): void => {
    setHidden(form, !editing);
    setHidden(start, editing);
  };
  show(false);
  return h("div", "rename-row", {}, start, form);
}
