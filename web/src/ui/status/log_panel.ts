import type { LogLine } from "../../session/console_state";
import type { ConsoleEngine } from "../../engine/console_engine";
import { h, type Panel } from "../elements/dom";

const SHOWN = 12;

/** Refusals with their reasons, and notices. */
export function createLogPanel(engine: ConsoleEngine): Panel {
  const list = h("ol", "log");
  const head = h("div", "card-head", {}, h("h2", "", {}, "Refusals and notices"));
  let shown = "";
  return {
    element: h("section", "card", { "aria-label": "Refusals and notices" }, head, list),
    update() {
      const lines = engine.state.log.slice(0, SHOWN);
      const key = lines.map((line) => `${line.atMs}/${line.count}`).join();
      if (key === shown) return;
      shown = key;
      list.replaceChildren(...lines.map(logLine));
    },
  };
}

function logLine(line: LogLine): HTMLElement {
  const time = new Date(line.atMs).toTimeString().slice(0, 8);
  const times = line.count > 1 ? ` ×${line.count}` : "";
  return h(
    "li",
    "log-line",
    { "data-level": line.level },
    h("time", "", {}, time),
    h("span", "", {}, line.text + times),
  );
}
