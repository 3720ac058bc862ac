import { stopAllLabels, type StopAll, type StopAllLabels } from "../stop_all";
import { button, h, setData, setHidden, setText, type Panel } from "../../ui/elements/dom";

export interface StopBarEvents {
  stop(reason: string): void;
  putAway(): void;
  whom(): string; // "8 robots"
}

/** STOP ALL: in every state of the page, for everyone; beside it what became of the last one. */
export function createStopBar(stop: StopAll, events: StopBarEvents): Panel {
  const words = h("span", "stop-words");
  const press = h(
    "button",
    "stop",
    { type: "button", "aria-keyshortcuts": "Escape" },
    h("span", "stop-name", {}, "STOP ALL"),
    h("span", "unseen", {}, "robots"),
    words,
  );
  // Pressing takes effect at once, without waiting for the release.
  press.addEventListener("pointerdown", (event) => {
    if (event.button === 0) events.stop("stop button");
  });
  // Keyboards and assistive tools click without a pointer.
  press.addEventListener("click", (event) => {
    if (event.detail === 0) events.stop("stop button");
  });
  const answer = createAnswer(events);
  const element = h("footer", "fleet-deck", {}, answer.element, press);
  return {
    element,
    update() {
      const said = stopAllLabels(stop);
      setData(press, "state", said?.tone === "pending" ? "pending" : "ready");
      setText(words, said?.tone === "pending" ? "sending to the robots…" : hint(events.whom()));
      answer.show(said);
    },
  };
}

function hint(whom: string): string {
  return document.documentElement.dataset["touch"] === "true" ? whom : `${whom} · Esc`;
}

interface Answer {
  readonly element: HTMLElement;
  show(words: StopAllLabels | null): void;
}

function createAnswer(events: StopBarEvents): Answer {
  const title = h("strong", "answer-title");
  const advice = h("p", "answer-advice");
  const missing = h("ul", "answer-missing");
  const unsaved = h("ul", "answer-missing");
  const stopped = h("p", "answer-stopped");
  const close = button("field-button", "Close", () => events.putAway());
  const said = h("div", "answer", { role: "alert" }, title, advice, missing, unsaved, stopped);
  const idle = h("p", "answer-idle muted");
  setText(
    idle,
    "STOP ALL stops every robot of this page, also those that the filter hides. A stop stays until it is reset on the robot’s own page.",
  );
  const element = h("div", "fleet-answer", {}, idle, said, close);
  return {
    element,
    show(words) {
      setHidden(idle, words !== null);
      setHidden(said, words === null);
      setHidden(close, words === null || words.tone === "pending");
      setData(element, "tone", words?.tone ?? "idle");
      if (words === null) return;
      setText(title, words.title);
      setText(advice, words.advice);
      setHidden(advice, words.advice === "");
      showLines(
        missing,
        words.missing.map(({ name, detail }) => `${name}: ${detail}`),
      );
      showLines(
        unsaved,
        words.unsaved.map((name) => `${name}: stopped, but NOT SAVED on its disk`),
      );
      setText(stopped, words.stopped.length === 0 ? "" : `Stopped: ${words.stopped.join(", ")}`);
    },
  };
}

/** Rebuilt only when it says something else: it is read out when it changes. */
function showLines(element: HTMLElement, lines: readonly string[]): void {
  setHidden(element, lines.length === 0);
  if (lines.join("\n") === [...element.children].map((each) => each.textContent).join("\n")) return;
  element.replaceChildren(...lines.map((line) => h("li", "", {}, line)));
}
