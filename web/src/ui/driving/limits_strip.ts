import { holdsSeat } from "../../session/console_state";
import { limitLabels } from "../../drive/labels/limit_labels";
import { goalRefusalWords, shownRefusal } from "../../drive/goals/goal_refusal";
import type { ConsoleEngine } from "../../engine/console_engine";
import { h, setHidden, type Panel } from "../elements/dom";

/** At the foot of the large view: what slows the robot down, or keeps it from moving on. */
export function createLimitsStrip(engine: ConsoleEngine): Panel {
  const element = h("ul", "limits", { "aria-label": "Limits of the robot", "aria-live": "polite" });
  let shown = "";
  return {
    element,
    update(now) {
      const { state } = engine;
      const share = holdsSeat(state) ? engine.driving.speedShare : (state.speedCap?.share ?? 1);
      const description = state.robot?.description ?? null;
      const refusal = shownRefusal(engine.driving.goals?.refusal ?? null, now);
      const refused = refusal === null ? [] : [goalRefusalWords(refusal, description)];
      const waits = engine.driving.goals?.saysWhatItWaitsFor(now) ?? false;
      const words = limitLabels(state.feedback, description, state.speedCap, share, refused, waits);
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
