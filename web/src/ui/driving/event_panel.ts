import { gateState } from "../../drive/command_gate";
import { holdsSeat, isOperator } from "../../session/console_state";
import { gateReason } from "../../drive/labels/gate_reason";
import { rateOf } from "../../util/samples";
import { GATE_REASON_LABELS, GATE_LABELS } from "../../drive/labels/labels";
import type { ConsoleEngine } from "../../engine/console_engine";
import { grouped, h, setData, setText, type Panel } from "../elements/dom";

/** A wait shorter than this is the loop at work, not something to read. */
const STEADY_MS = 400;

/** The event reference and why the next command may or may not go. */
export function createEventPanel(engine: ConsoleEngine): Panel {
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
      const found =
        engine.driving.driver === null ? "no_feedback" : gateState(engine.driving.driver.gate, now);
      if (found === "open" || found === "rate") openMs = now;
      const blocked = gateReason(
        engine.state,
        engine.hears(now),
        engine.stopping.outranks(engine.state.stop, now),
      );
      const flows = blocked === null && now - openMs < STEADY_MS;
      setText(number, engine.state.feedback === null ? "–" : grouped(engine.state.feedback.event));
      setText(rate, `${rateOf(engine.events, now).toFixed(1)} /s`);
      const watches = engine.state.welcome !== null && !isOperator(engine.state) && !holdsSeat(engine.state);
      setData(gate, "tone", watches ? "off" : flows ? "good" : "wait");
      setText(state, watches ? "Watching" : flows ? "Gate open" : "Gate shut");
      setText(
        words,
        watches
          ? driverWords(engine)
          : blocked === null
            ? GATE_LABELS[flows ? "open" : found]
            : GATE_REASON_LABELS[blocked],
      );
    },
  };
}

function driverWords(engine: ConsoleEngine): string {
  const name = engine.state.seat?.name ?? "";
  return name === "" ? "Nobody drives" : `${name} drives`;
}
