import type { Axis } from "../../protocol/wire";
import { quantity, scaleFor } from "../../util/units";
import { h, setText } from "../elements/dom";
import type { AxisBar } from "./axis_bar";

/** One rate axis: as measured, from its rest value, and as commanded. */
export function createRateBar(axis: Axis): AxisBar {
  const value = h("span", "axis-value");
  const fill = h("span", "axis-fill");
  const mark = h("span", "axis-mark");
  const track = h("span", "axis-track", { "aria-hidden": "true" }, fill, mark);
  const line = h("span", "axis-line", {}, h("span", "axis-label", {}, axis.label), value);
  const share = (amount: number): number => (amount - axis.minimum) / (axis.maximum - axis.minimum || 1);
  const middle = share(axis.rest);
  const scale = scaleFor(axis.unit, Math.max(Math.abs(axis.minimum), Math.abs(axis.maximum)));
  return {
    axis,
    element: h("div", "axis", {}, line, track),
    show(_now, measured, commanded) {
      const at = Math.min(1, Math.max(0, share(measured ?? axis.rest)));
      fill.style.left = percent(Math.min(at, middle));
      fill.style.width = percent(Math.abs(at - middle));
      mark.style.left = percent(Math.min(1, Math.max(0, share(commanded ?? axis.rest))));
      setText(value, measured === undefined ? "–" : quantity(measured, scale));
    },
  };
}

function percent(share: number): string {
  return `${(share * 100).toFixed(1)}%`;
}
