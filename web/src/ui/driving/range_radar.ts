import { quantity, scaleFor } from "../../util/units";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { RangeRing } from "../../protocol/wire";
import { h, setHidden, setText, svg, type Panel } from "../elements/dom";
import { createStaleMark } from "../elements/stale_mark";

const RADIUS = 52;

/** What the ring of range sensors sees, from above (forward is up). */
export function createRangeRadar(engine: ConsoleEngine): Panel {
  const drawing = svg("svg", { viewBox: "-56 -56 112 112", class: "gauge-drawing", "aria-hidden": "true" });
  const free = svg("path", { class: "radar-free" });
  drawing.append(
    svg("circle", { r: String(RADIUS), class: "gauge-ring" }),
    svg("circle", { r: String(RADIUS / 2), class: "gauge-ring faint" }),
    free,
    svg("path", { d: "M0-7L5 6L0 3L-5 6Z", class: "gauge-hub" }),
  );
  const value = h("span", "gauge-value");
  const stale = createStaleMark(engine);
  const element = h(
    "div",
    "gauge radar",
    { role: "group", "aria-label": "Nearest obstacle" },
    h("span", "gauge-name", {}, "Nearest"),
    drawing,
    value,
    stale.element,
  );
  return {
    element,
    update(now) {
      stale.update(now);
      const ring = engine.state.robot?.description.ranges ?? null;
      const ranges = engine.state.feedback?.ranges ?? [];
      setHidden(element, ring === null || ranges.length === 0);
      if (ring === null || ranges.length === 0) return;
      free.setAttribute("d", outline(ring, ranges));
      const nearest = Math.min(...ranges);
      setText(value, nearest >= ring.range_max ? "clear" : quantity(nearest, scaleFor("m", ring.range_max)));
    },
  };
}

function outline(ring: RangeRing, ranges: readonly number[]): string {
  const points = ranges.map((range, index) => {
    const angle = ring.angle_min + index * ring.angle_increment;
    const radius = RADIUS * Math.min(1, Math.max(0, range / ring.range_max));
    return `${(-Math.sin(angle) * radius).toFixed(1)} ${(-Math.cos(angle) * radius).toFixed(1)}`;
  });
  return `M${points.join("L")}Z`;
}
