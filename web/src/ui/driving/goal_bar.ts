import type { ConsoleEngine } from "../../engine/console_engine";
import { refusedAxis, shownRefusal } from "../../drive/goals/goal_refusal";
import { endLabel, endOf, figureOf, shareOf } from "../../drive/goals/goal_figures";
import { REACH_SHARE } from "../../drive/goals/goal_range";
import type { GoalSliders } from "../../input/goal_sliders";
import type { Axis } from "../../protocol/wire";
import { mayDrive } from "../../session/console_state";
import { h, setData, setHidden, setText } from "../elements/dom";
import type { AxisBar } from "./axis_bar";
import { inputHint } from "./input_hint";

/**
 * One goal axis: where it is measured, the goal that the robot applies, the one that is commanded now, its limits, and
 * how far from the measured place a goal may be. The bar is a slider that is held to run.
 */
export function createGoalBar(
  engine: ConsoleEngine,
  sliders: GoalSliders,
  axis: Axis,
  index: number,
): AxisBar {
  const value = h("span", "axis-value");
  const beside = h("span", "axis-beside");
  const hint = h("span", "axis-hint", { "aria-hidden": "true" });
  const label = h("span", "axis-label", {}, axis.label);
  const reach = h("span", "goal-reach");
  const way = h("span", "goal-way");
  const measuredMark = h("span", "goal-measured");
  const commandedMark = h("span", "goal-commanded");
  const thumb = h("span", "goal-thumb");
  const track = h("span", "goal-track", {}, reach, way, measuredMark, thumb, commandedMark);
  const slider = h("div", "goal-slider", sliderAttributes(axis), track);
  const [least, most] = [endLabel(axis, axis.minimum), endLabel(axis, axis.maximum)];
  const ends = h(
    "span",
    "goal-ends",
    { "aria-hidden": "true" },
    h("span", "", {}, least),
    h("span", "", {}, most),
  );
  const line = h("span", "axis-line", {}, label, hint, h("span", "axis-figures", {}, beside, value));
  const element = h("div", "axis goal", { "data-axis": axis.name }, line, slider, ends);
  sliders.add(axis.name, slider);
  return {
    axis,
    element,
    show(now, measured, commanded) {
      const applied = engine.state.feedback?.goals[index] ?? null;
      const refusal = shownRefusal(engine.driving.goals?.refusal ?? null, now);
      const { robot } = engine.state;
      const isRefused = refusal !== null && refusedAxis(refusal, robot?.description ?? null) === axis;
      const end = measured === undefined ? null : endOf(axis, applied ?? measured);
      const drives = typeof commanded === "number";
      setData(
        element,
        "state",
        isRefused ? "refused" : drives ? "driven" : engine.driving.isArmed() ? "armed" : "idle",
      );
      setData(element, "end", end ?? "");
      place(measuredMark, axis, measured);
      place(thumb, axis, applied ?? undefined);
      place(commandedMark, axis, drives ? commanded : undefined);
      span(reach, axis, measured, axis.reach * REACH_SHARE);
      between(way, axis, measured, applied ?? undefined);
      const figure = measured === undefined ? null : figureOf(axis, measured);
      setText(hint, hintOf(engine, axis));
      setText(value, figure?.main ?? "–");
      setText(beside, figure?.beside ?? "");
      describe(slider, engine, axis, measured, applied);
    },
  };
}

/** Which input moves the axis in the active layer. */
function hintOf(engine: ConsoleEngine, axis: Axis): string {
  if (!mayDrive(engine.state)) return "";
  const layer = engine.state.robot?.description.layers[engine.driving.layer];
  const binding = layer?.bindings.find((each) => each.axis === axis.name);
  const touches = document.documentElement.dataset["touch"] === "true";
  return inputHint(binding, engine.controls.hasPad ? "pad" : touches ? "touch" : "keys");
}

function sliderAttributes(axis: Axis): Record<string, string> {
  return {
    role: "slider",
    "aria-label": axis.label,
    "aria-valuemin": String(axis.minimum),
    "aria-valuemax": String(axis.maximum),
    "aria-valuenow": String(axis.rest),
  };
}

/** The text for a screen reader: where the axis is, where it is told to be, and whether the slider moves it now. */
function describe(
  slider: HTMLElement,
  engine: ConsoleEngine,
  axis: Axis,
  measured: number | undefined,
  applied: number | null,
): void {
  setAttribute(slider, "tabindex", mayDrive(engine.state) ? "0" : "-1");
  setAttribute(slider, "aria-disabled", String(!engine.driving.isArmed()));
  if (measured === undefined) {
    setAttribute(slider, "aria-valuetext", "not known");
    return;
  }
  setAttribute(slider, "aria-valuenow", measured.toPrecision(4));
  const goal = applied === null ? "" : `, goal ${figureOf(axis, applied).main}`;
  setAttribute(slider, "aria-valuetext", `${figureOf(axis, measured).main}${goal}`);
}

function setAttribute(element: HTMLElement, name: string, text: string): void {
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

function place(mark: HTMLElement, axis: Axis, at: number | undefined): void {
  setHidden(mark, at === undefined);
  if (at !== undefined) mark.style.left = percent(shareOf(axis, at));
}

function span(band: HTMLElement, axis: Axis, at: number | undefined, reach: number): void {
  setHidden(band, at === undefined || reach <= 0);
  if (at === undefined) return;
  const share = reach / (axis.maximum - axis.minimum || 1);
  const middle = shareOf(axis, at);
  const from = Math.max(0, middle - share);
  band.style.left = percent(from);
  band.style.width = percent(Math.min(1, middle + share) - from);
}

function between(line: HTMLElement, axis: Axis, from: number | undefined, to: number | undefined): void {
  setHidden(line, from === undefined || to === undefined);
  if (from === undefined || to === undefined) return;
  const shares = [shareOf(axis, from), shareOf(axis, to)] as const;
  const left = Math.min(...shares);
  // Across the border of an axis that turns on and on the line would cross the whole bar.
  const width = Math.max(...shares) - left;
  setHidden(line, axis.wrap !== null && width > 0.5);
  line.style.left = percent(left);
  line.style.width = percent(width);
}

function percent(share: number): string {
  return `${(share * 100).toFixed(2)}%`;
}
