import { robotIsUp } from "../../session/console_state";
import { pressedStopLabel, restingStopLabel } from "../../stop/stop_labels";
import type { ConsoleEngine } from "../../engine/console_engine";
import { h, setData, setText, type Panel } from "../elements/dom";

/** STOP: on every screen, for everyone. Pressing takes effect at once, without waiting for the release. */
export function createStopPanel(engine: ConsoleEngine): Panel {
  const words = h("span", "stop-words");
  const element = h(
    "button",
    "stop",
    { type: "button", "aria-keyshortcuts": "Escape" },
    h("span", "stop-name", {}, "STOP"),
    h("span", "unseen", {}, "the robot"),
    words,
  );
  const press = (): void => engine.stop("stop button");
  element.addEventListener("pointerdown", (event) => {
    if (event.button === 0) press();
  });
  // Keyboards and assistive tools click without a pointer.
  element.addEventListener("click", (event) => {
    if (event.detail === 0) press();
  });
  const restingWords = (heard: boolean): string =>
    restingStopLabel(engine.state.stop.stopped, heard, document.documentElement.dataset["touch"] === "true");
  return {
    element,
    update(now) {
      const fate = engine.stopping.fate(now);
      setData(element, "state", fate === null ? (engine.state.stop.stopped ? "stopped" : "ready") : fate);
      const heard = engine.hears(now) && robotIsUp(engine.state);
      setText(words, fate === null ? restingWords(heard) : pressedStopLabel(fate, heard));
    },
  };
}
