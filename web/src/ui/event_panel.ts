import { gateState } from "../core/command_gate";
import { holdsSeat, isOperator } from "../core/console_state";
import { gateBlock } from "../core/gate_block";
import { rateOf } from "../core/samples";
import { GATE_BLOCK_WORDS, GATE_WORDS } from "../core/words";
import type { ConsoleApp } from "../console_app";
import { grouped, h, setData, setText, type Panel } from "./dom";

/** A wait shorter than this is the loop at work, not something to read. */
const STEADY_MS = 400;

/** The event reference and why the next command may or may not go. */
export function createEventPanel(app: ConsoleApp): Panel {
  const number = h("output", "event-number", { "aria-label": "Event reference" });
  const rate = h("span", "event-rate");
  const state = h("strong", "gate-state");
  const words = h("span", "gate-words");
  const gate = h("div", "gate", {}, h("span", "gate-lamp"), state, words);
  const element = h(
    "section",
    "event card",
    { "aria-label": "Event" },
    h("div", "event-head", {}, h("h2", "", {}, "Event"), rate),
    number,
    gate,
  );
  let openMs = -Infinity;
  return {
    element,
    update(now) {
      const found = app.driver === null ? "no_feedback" : gateState(app.driver.gate, now);
      if (found === "open" || found === "rate") openMs = now;
      const blocked = gateBlock(app.state, app.hears(now), app.stopping.outranks(app.state.stop, now));
      const flows = blocked === null && now - openMs < STEADY_MS;
      setText(number, app.state.feedback === null ? "–" : grouped(app.state.feedback.event));
      setText(rate, `${rateOf(app.events, now).toFixed(1)} /s`);
      const watches = app.state.welcome !== null && !isOperator(app.state) && !holdsSeat(app.state);
      setData(gate, "tone", watches ? "off" : flows ? "good" : "wait");
      setText(state, watches ? "Watching" : flows ? "Gate open" : "Gate shut");
      setText(
        words,
        watches
          ? driverWords(app)
          : blocked === null
            ? GATE_WORDS[flows ? "open" : found]
            : GATE_BLOCK_WORDS[blocked],
      );
    },
  };
}

function driverWords(app: ConsoleApp): string {
  const name = app.state.seat?.name ?? "";
  return name === "" ? "Nobody drives" : `${name} drives`;
}
