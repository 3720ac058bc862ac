import { axisPositionsOf, axisPositionLabel, type AxisPosition } from "../../drive/axis_positions";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { RobotDescription } from "../../protocol/wire";
import { h, setHidden, setText, type Panel } from "../elements/dom";
import { createStaleMark } from "../elements/stale_mark";

const MOST = 6; // rows
const LOOK_MS = 500; // between two looks at whether it fits
const ROW_PX = 19;
const FRAME_PX = 44; // the panel without rows, and its gap
const GAP_PX = 14;

/** Where the joints are that are moved one by one; only where there is room beside the gauges. */
export function createAxisPositionPanel(engine: ConsoleEngine): Panel {
  const rows = h("dl", "place-rows");
  const stale = createStaleMark(engine);
  const name = h("span", "gauge-name", {}, "Position");
  const element = h("div", "places", { role: "group", "aria-label": "Position" }, name, rows, stale.element);
  let description: RobotDescription | null = null;
  let shown: { place: AxisPosition; value: HTMLElement }[] = [];
  let fits = false;
  let dueMs = 0;
  return {
    element,
    update(now) {
      stale.update(now);
      const found = engine.state.robot?.description ?? null;
      if (found !== null && found !== description) {
        description = found;
        shown = axisPositionsOf(found)
          .slice(0, MOST)
          .map((place) => ({ place, value: h("dd", "place-value") }));
        rows.replaceChildren(
          ...shown.map(({ place, value }) =>
            h("div", "place-row", {}, h("dt", "place-label", {}, place.label), value),
          ),
        );
        dueMs = 0;
      }
      if (now >= dueMs) {
        dueMs = now + LOOK_MS;
        fits = roomBeside(element) >= FRAME_PX + ROW_PX * shown.length;
      }
      setHidden(element, shown.length === 0 || !fits);
      for (const { place, value } of shown) setText(value, axisPositionLabel(place, engine.state.feedback));
    },
  };
}

/** What is left of the column under the small views and beside the other gauges: CSS pixels. */
function roomBeside(element: HTMLElement): number {
  const column = element.parentElement;
  const board = column?.parentElement;
  if (!column || !board || column.clientHeight === 0) return 0;
  const small = [...board.querySelectorAll<HTMLElement>('.view[data-place="small"]')];
  const top = Math.max(0, ...small.map((view) => view.offsetTop + view.offsetHeight));
  const others = [...column.children].filter((each) => each !== element);
  const taken = others.reduce((sum, each) => sum + each.clientHeight, 0) + GAP_PX * others.length;
  return column.offsetTop + column.offsetHeight - top - taken;
}
