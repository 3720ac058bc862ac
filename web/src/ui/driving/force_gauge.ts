import { contactStrength, feelingOf, forceOf } from "../../haptics/contact_force";
import { TRACE_EVENTS, tracePath, type ForceTrace } from "../../haptics/force_trace";
import { quantity, scaleFor } from "../../util/units";
import type { ForceFeeling, RobotDescription } from "../../protocol/wire";
import { h, setData, setHidden, setText, svg, type Panel } from "../elements/dom";
import { createStaleMark } from "../elements/stale_mark";

const TRACE_WIDTH = 120;
const TRACE_HEIGHT = 28;
const REACH = 44; // of the arrow, in the drawing's units

/** Where forces come from: a running console, or a recording. */
export interface ForceSource {
  readonly measuredMs: number | null; // when it was measured; null: it cannot be old
  readonly state: {
    readonly robot: { readonly description: RobotDescription } | null;
    readonly feedback: { readonly wrench: readonly number[] } | null;
  };
  readonly haptics: { readonly trace: ForceTrace } | null; // null: its code is not there yet
}

/**
 * The contact force: an arrow seen from above (forward is up), and a meter.
 * `onContact`: it shows only while there is contact, over the picture.
 */
export function createForceGauge(engine: ForceSource, onContact: boolean): Panel {
  const drawing = svg("svg", { viewBox: "-56 -56 112 112", class: "gauge-drawing", "aria-hidden": "true" });
  const arrow = svg("path", { class: "force-arrow" });
  drawing.append(
    svg("circle", { r: "52", class: "gauge-ring" }),
    svg("circle", { r: "26", class: "gauge-ring faint" }),
    svg("path", { d: "M0-52v8M0 52v-8M-52 0h8M52 0h-8", class: "gauge-ring" }),
    arrow,
    svg("circle", { r: "4", class: "gauge-hub" }),
  );
  const value = h("span", "gauge-value");
  const stale = createStaleMark(engine);
  const fill = h("span", "meter-fill");
  const threshold = h("span", "meter-mark");
  const meter = h("span", "meter", { "aria-hidden": "true" }, fill, threshold);
  const trace = createTrace();
  const element = h(
    "div",
    onContact ? "gauge force contact" : "gauge force",
    { role: "group", "aria-label": "Contact force" },
    h("span", "gauge-name", {}, "Force"),
    drawing,
    value,
    stale.element,
    meter,
    trace.element,
  );
  return {
    element,
    update(now) {
      stale.update(now);
      const sensor = engine.state.robot?.description.wrench ?? null;
      const wrench = engine.state.feedback?.wrench ?? [];
      const force = forceOf(wrench);
      const description = engine.state.robot?.description;
      const feeling = description === undefined ? null : feelingOf(description);
      const strength = feeling === null ? 0 : contactStrength(force, feeling);
      setHidden(element, sensor === null || wrench.length < 3 || (onContact && strength === 0));
      if (sensor === null || feeling === null) return;
      if (engine.haptics !== null)
        trace.show(tracePath(engine.haptics.trace, feeling.full_newtons, TRACE_WIDTH, TRACE_HEIGHT), feeling);
      setData(element, "tone", strength >= 0.7 ? "bad" : strength > 0 ? "wait" : "good");
      arrow.setAttribute("d", arrowPath(wrench[0] ?? 0, wrench[1] ?? 0, sensor.full_scale_force));
      const scale = scaleFor("N", sensor.full_scale_force);
      setText(value, quantity(force, { ...scale, digits: force * scale.factor < 100 ? 1 : 0 }));
      fill.style.width = `${Math.min(100, (100 * force) / sensor.full_scale_force).toFixed(1)}%`;
      threshold.style.left = `${((100 * sensor.threshold_force) / sensor.full_scale_force).toFixed(1)}%`;
    },
  };
}

/** The force over the last events, between nothing and what is felt at its strongest. */
function createTrace(): { element: SVGElement; show(path: string, feeling: ForceFeeling): void } {
  const area = svg("path", { class: "trace-area" });
  const threshold = svg("line", { x1: "0", x2: String(TRACE_WIDTH), class: "trace-threshold" });
  const element = svg("svg", {
    viewBox: `0 0 ${TRACE_WIDTH} ${TRACE_HEIGHT}`,
    preserveAspectRatio: "none",
    class: "force-trace",
    role: "img",
    "aria-label": `Force over the last ${TRACE_EVENTS} events`,
  });
  element.append(area, threshold);
  return {
    element,
    show(path, feeling) {
      if (area.getAttribute("d") !== path) area.setAttribute("d", path);
      const level = (TRACE_HEIGHT * (1 - feeling.threshold_newtons / feeling.full_newtons)).toFixed(1);
      if (threshold.getAttribute("y1") === level) return;
      threshold.setAttribute("y1", level);
      threshold.setAttribute("y2", level);
    },
  };
}

/** x forward is up, y left is left (REP 103). */
function arrowPath(forward: number, left: number, fullScale: number): string {
  const size = Math.hypot(forward, left);
  const length = Math.min(1, size / fullScale) * REACH;
  if (length < 3) return "";
  const [x, y] = [-left / size, -forward / size];
  const point = (along: number, across: number): string =>
    `${(x * along - y * across).toFixed(1)} ${(y * along + x * across).toFixed(1)}`;
  const neck = Math.max(0, length - 10);
  return `M${point(0, 2.5)}L${point(neck, 2.5)}L${point(neck, 8)}L${point(length, 0)}L${point(neck, -8)}L${point(neck, -2.5)}L${point(0, -2.5)}Z`;
}
