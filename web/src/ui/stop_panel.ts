import type { ConsoleApp } from "../console_app";
import { h, setData, setText, type Panel } from "./dom";

/** STOP: on every screen, for everyone. Pressing takes effect at once, without waiting for the release. */
export function createStopPanel(app: ConsoleApp): Panel {
  const words = h("span", "stop-words");
  const element = h(
    "button",
    "stop",
    { type: "button", "aria-label": "Stop the robot" },
    h("span", "stop-name", {}, "STOP"),
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
  return {
    element,
    update() {
      const stopped = app.state.stop.stopped;
      setData(element, "state", app.stopping.isPending ? "pending" : stopped ? "stopped" : "ready");
      setText(words, stopWords(app));
    },
  };
}

function stopWords(app: ConsoleApp): string {
  if (app.stopping.isPending) return "telling the robot…";
  if (app.state.stop.stopped) return "robot is stopped";
  return app.stopping.failed
    ? "NOT CONFIRMED: press again"
    : document.documentElement.dataset["touch"] === "true"
      ? ""
      : "Esc";
}
