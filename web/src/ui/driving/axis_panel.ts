import { holdsSeat, isOperator } from "../../session/console_state";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { RobotDescription } from "../../protocol/wire";
import { button, h, setData, setHidden, setPressed, type Panel } from "../elements/dom";
import { createStaleMark } from "../elements/stale_mark";

/** The control layers, and the axes. */
export function createAxisPanel(engine: ConsoleEngine, bars: Panel): Panel {
  const layers = h("div", "segments layers", { role: "group", "aria-label": "Control layer" });
  const stale = createStaleMark(engine);
  const element = h("section", "axis-panel", { "aria-label": "Axes" }, layers, bars.element, stale.element);
  let description: RobotDescription | null = null;
  return {
    element,
    update(now) {
      stale.update(now);
      const found = engine.state.robot?.description ?? null;
      if (found !== null && found !== description) {
        description = found;
        layers.replaceChildren(
          ...found.layers.map((layer, index) =>
            button("segment", layer.label, () => engine.driving.selectLayer(index)),
          ),
        );
        setData(layers, "crowd", found.layers.length > 3 ? "many" : found.layers.length > 2 ? "some" : "");
      }
      setHidden(
        layers,
        (!isOperator(engine.state) && !holdsSeat(engine.state)) || layers.childElementCount < 2,
      );
      for (const [index, child] of [...layers.children].entries())
        if (child instanceof HTMLElement) setPressed(child, index === engine.driving.layer);
      bars.update(now);
    },
  };
}
