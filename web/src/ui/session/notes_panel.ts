import type { ConsoleEngine } from "../../engine/console_engine";
import type { SharedNote } from "../../protocol/wire";
import { grouped, h, setHidden, setText, type Panel } from "../elements/dom";

/** Notes to everyone, each with the event it belongs to. Opening the field disarms: keys then write and do not drive. */
export function createNotesPanel(engine: ConsoleEngine): Panel {
  const list = h("ol", "notes", { "aria-live": "polite", "aria-label": "Notes" });
  const empty = h(
    "p",
    "notes-empty",
    {},
    "No notes yet. A note goes to everyone and is kept with its event.",
  );
  const composer = createComposer(engine);
  let shown: readonly SharedNote[] = [];
  return {
    element: h("section", "notes-panel", { "aria-label": "Notes" }, empty, list, composer.element),
    update(now) {
      composer.update(now);
      const { notes } = engine.state;
      setHidden(empty, notes.length > 0);
      if (notes.length === shown.length && notes.at(-1) === shown.at(-1)) return;
      const atEnd = list.scrollHeight - list.scrollTop - list.clientHeight < 40;
      shown = [...notes];
      list.replaceChildren(...notes.map((note) => noteLine(note, note.peer === engine.state.welcome?.peer)));
      if (atEnd) list.scrollTop = list.scrollHeight;
    },
  };
}

function createComposer(engine: ConsoleEngine): Panel {
  const field = h("textarea", "field", {
    rows: "2",
    maxlength: "500",
    placeholder: "Note to everyone",
    "aria-label": "Note to everyone",
  });
  const send = h("button", "field-button", { type: "submit" }, "Send");
  const hint = h("span", "composer-hint");
  const form = h("form", "composer", {}, field, h("div", "composer-foot", {}, hint, send));
  let failed = false;
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (field.value.trim() === "") return;
    failed = !engine.session.writeNote(field.value);
    if (!failed) field.value = "";
  });
  field.addEventListener("keydown", (event) => {
    if (event.code === "Escape") field.blur();
    if (event.code !== "Enter" || event.shiftKey || event.isComposing) return;
    event.preventDefault();
    form.requestSubmit();
  });
  return {
    element: form,
    update() {
      const { feedback, welcome } = engine.state;
      const event = feedback === null ? "" : `Kept with event ${grouped(feedback.event)}`;
      setText(
        hint,
        failed ? "Not sent: there is no connection" : engine.driving.isArmed() ? "Writing disarms" : event,
      );
      send.disabled = welcome === null || field.value.trim() === "";
    },
  };
}

function noteLine(note: SharedNote, mine: boolean): HTMLElement {
  const time = new Date(note.time * 1000).toTimeString().slice(0, 5);
  const who = h("span", "note-name", {}, mine ? `${note.name} (you)` : note.name);
  const about = h("span", "note-about", {}, `${note.role} · ${time}`);
  const event = h("span", "note-event", {}, `event ${grouped(note.event)}`);
  return h("li", "note", {}, who, about, event, h("p", "note-text", {}, note.text));
}
