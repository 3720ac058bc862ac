import { holdsSeat } from "../core/console_state";
import { limitWords } from "../core/limit_words";
import type { ConsoleApp } from "../console_app";
import { h, setHidden, type Panel } from "./dom";

/** At the foot of the large view: what slows the robot down, or keeps it from moving on. */
export function createLimitsStrip(app: ConsoleApp): Panel {
  const element = h("ul", "limits", { "aria-label": "What limits the robot", "aria-live": "polite" });
  let shown = "";
  return {
    element,
    update() {
      const { state } = app;
      const share = holdsSeat(state) ? app.speedShare : (state.speedCap?.share ?? 1);
      const words = limitWords(state.feedback, state.robot?.description ?? null, state.speedCap, share);
      const key = JSON.stringify(words);
      if (key === shown) return;
      shown = key;
      setHidden(element, words.length === 0);
      element.replaceChildren(
        ...words.map((each) =>
          h("li", "limit", { "data-tone": each.tone }, h("span", "limit-text", {}, each.text)),
        ),
      );
    },
  };
}
