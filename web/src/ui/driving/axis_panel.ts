import { holdsSeat, isOperator } from "../../session/console_state";
import type { ConsoleEngine } from "../../engine/console_engine";
import { quantity, scaleFor } from "../../util/units";
import type { Axis, RobotDescription } from "../../protocol/wire";
import { button, h, setData, setHidden, setPressed, setText, type Panel } from "../elements/dom";
import { createStaleMark } from "../elements/stale_mark";

interface AxisBar {
  readonly axis: Axis;
  readonly element: HTMLElement;
  show(measured: number | undefined, commanded: number | undefined): void;
}

/** The control layers, and each axis as commanded and as measured. */
export function createAxisPanel(engine: ConsoleEngine): Panel {
  const layers = h("div", "segments layers", { role: "group", "aria-label": "Control layer" });
  const bars = h("div", "axes");
  const stale = createStaleMark(engine);
  const element = h("section", "axis-panel", { "aria-label": "Axes" }, layers, bars, stale.element);
  let description: RobotDescription | null = null;
  let shown: AxisBar[] = [];
  return {
    element,
    update(now) {
      stale.update(now);
      const found = engine.state.robot?.description ?? null;
      if (found !== null && found !== description) {
        description = found;
        shown = found.axes.map(createBar);
        bars.replaceChildren(...shown.map((bar) => bar.element));
        layers.replaceChildren(
          ...found.layers.map((layer, index) =>
            button("segment", layer.label, () => engine.selectLayer(index)),
          ),
        );
        setData(layers, "crowd", found.layers.length > 3 ? "many" : found.layers.length > 2 ? "some" : "");
      }
      setHidden(
        layers,
        (!isOperator(engine.state) && !holdsSeat(engine.state)) || layers.childElementCount < 2,
      );
      for (const [index, child] of [...layers.children].entries())
        if (child instanceof HTMLElement) setPressed(child, index === engine.layer);
      showBars(engine, shown);
    },
  };
}

/** Only the axes of the active layer fit; an observer sees the first layer's. */
function showBars(engine: ConsoleEngine, bars: readonly AxisBar[]): void {
  const layer = engine.state.robot?.description.layers[engine.layer];
  const names = new Set(layer?.bindings.map((binding) => binding.axis));
  for (const [index, bar] of bars.entries()) {
    setHidden(bar.element, names.size > 0 && !names.has(bar.axis.name));
    const feedback = engine.state.feedback;
    const known = feedback?.unknown.includes(bar.axis.name) === false;
    bar.show(known ? feedback.axes[index] : undefined, engine.values[index]);
  }
}

function createBar(axis: Axis): AxisBar {
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
    show(measured, commanded) {
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
