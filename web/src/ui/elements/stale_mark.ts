import { feedbackAge } from "../../drive/feedback_age";
import { h, setHidden, setText, type Panel } from "./dom";

/** Stands beside measured values, and says how old they are when they are not the present ones. */
export function createStaleMark(engine: { readonly measuredMs: number | null }): Panel {
  const element = h("span", "stale-mark");
  return {
    element,
    update(now) {
      const age = feedbackAge(engine.measuredMs, now);
      setHidden(element, age === null);
      setText(element, age === null ? "" : `${age} old`);
    },
  };
}
