import type { ConsoleEngine } from "../../engine/console_engine";
import { addGoalControls } from "../../engine/goal_controls";
import { axesShown } from "../../drive/axes_shown";
import type { RobotDescription } from "../../protocol/wire";
import { h, setData, setHidden, type Panel } from "../elements/dom";
import type { AxisBar } from "./axis_bar";
import { createGoalBar } from "./goal_bar";
import { createRateBar } from "./rate_bar";

/** Each axis of the active layer as measured and as commanded. */
export function createAxisBars(engine: ConsoleEngine): Panel {
  const sliders = addGoalControls(engine);
  const element = h("div", "axes");
  let description: RobotDescription | null = null;
  let bars: AxisBar[] = [];
  return {
    element,
    update(now) {
      const { robot, feedback } = engine.state;
      const found = robot?.description ?? description;
      if (found !== null && found !== description) {
        description = found;
        sliders.forget();
        bars = found.axes.map((axis, index) =>
          axis.kind === "goal" ? createGoalBar(engine, sliders, axis, index) : createRateBar(axis),
        );
        element.replaceChildren(...bars.map((bar) => bar.element));
      }
      if (description === null) return;
      const names = axesShown(description, engine.driving.layer);
      const shown = bars.filter(({ axis }) => names.has(axis.name));
      setData(element, "goals", String(shown.some(({ axis }) => axis.kind === "goal")));
      setData(element, "crowd", shown.length > 6 ? "most" : shown.length > 4 ? "many" : "");
      setData(element, "rates", String(shown.some(({ axis }) => axis.kind === "rate")));
      for (const [index, bar] of bars.entries()) {
        setHidden(bar.element, !names.has(bar.axis.name));
        const known = feedback?.unknown.includes(bar.axis.name) === false;
        bar.show(now, known ? feedback.axes[index] : undefined, engine.driving.values[index]);
      }
    },
  };
}
