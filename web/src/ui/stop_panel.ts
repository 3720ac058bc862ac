import { robotIsUp } from "../core/console_state";
import { restingStopWords, STOP_BUTTON_WORDS } from "../core/stop_words";
import type { ConsoleApp } from "../console_app";
import { h, setData, setText, type Panel } from "./dom";

/** STOP: on every screen, for everyone. Pressing takes effect at once, without waiting for the release. */
export function createStopPanel(app: ConsoleApp): Panel {
  const words = h("span", "stop-words");
  const element = h(
    "button",
    "stop",
    { type: "button", "aria-keyshortcuts": "Escape" },
    h("span", "stop-name", {}, "STOP"),
    h("span", "unseen", {}, "the robot"),
    words,
  );
  const press = (): void => app.stop("stop button");
  element.addEventListener("pointerdown", (event) => {
    if (event.button === 0) press();
  });
  // Keyboards and assistive tools click without a pointer.
  element.addEventListener("click", (event) => {
    if (event.detail === 0) press();
  });
  const restingWords = (now: number): string => {
    const heard = app.hears(now) && robotIsUp(app.state);
    return restingStopWords(
      app.state.stop.stopped,
      heard,
      document.documentElement.dataset["touch"] === "true",
    );
  };
  return {
    element,
    update(now) {
      const fate = app.stopping.fate(now);
      setData(element, "state", fate === null ? (app.state.stop.stopped ? "stopped" : "ready") : fate);
      setText(words, fate === null ? restingWords(now) : STOP_BUTTON_WORDS[fate]);
    },
  };
}
