import { figureOf, shareOf } from "../../drive/goals/goal_figures";
import type { Axis, RobotDescription } from "../../protocol/wire";
import { h, setHidden, setText } from "../../ui/elements/dom";

interface AxisRow {
  readonly element: HTMLElement;
  show(
    commanded: number | null | undefined,
    measured: number | undefined,
    applied: number | null | undefined,
  ): void;
}

/** Each axis as commanded and as measured, in figures and as a bar; of a goal axis also the goal that was applied. */
export class AxisRows {
  readonly element = h("section", "card axis-rows", { "aria-label": "Command and feedback" });
  private readonly rows: readonly AxisRow[];

  constructor(description: RobotDescription) {
    this.rows = description.axes.map(createRow);
    const head = h(
      "div",
      "axis-row head",
      {},
      h("h2", "", {}, "Axis"),
      h("h2", "", {}, "Command"),
      h("h2", "", {}, "Feedback"),
    );
    this.element.append(head, ...this.rows.map((row) => row.element));
  }

  /** `commanded` is empty when there is no command; an axis of `unknown` (by number) was not measured. */
  show(
    commanded: readonly (number | null)[],
    measured: readonly number[],
    applied: readonly (number | null)[],
    unknown: ReadonlySet<number>,
  ): void {
    for (const [at, row] of this.rows.entries())
      row.show(commanded[at], unknown.has(at) ? undefined : measured[at], applied[at]);
  }
}

function createRow(axis: Axis): AxisRow {
  const command = h("span", "axis-figure");
  const feedback = h("span", "axis-figure");
  const fill = h("span", "axis-fill");
  const goal = h("span", "axis-goal");
  const mark = h("span", "axis-mark");
  const track = h("span", "axis-track", { "aria-hidden": "true" }, fill, goal, mark);
  const isGoal = axis.kind === "goal";
  // A rate is drawn from where it moves nothing; a place is a mark between the limits.
  const middle = shareOf(axis, axis.rest);
  const label = h("span", "axis-label", {}, axis.label);
  return {
    element: h(
      "div",
      "axis-row",
      { "data-axis": axis.name, "data-kind": axis.kind },
      label,
      command,
      feedback,
      track,
    ),
    show(commanded, measured, applied) {
      const at = shareOf(axis, measured ?? axis.rest);
      fill.style.left = percent(isGoal ? at : Math.min(at, middle));
      fill.style.width = isGoal ? "" : percent(Math.abs(at - middle));
      setHidden(fill, isGoal && measured === undefined);
      setHidden(goal, typeof applied !== "number");
      goal.style.left = percent(shareOf(axis, applied ?? axis.rest));
      setHidden(mark, typeof commanded !== "number");
      mark.style.left = percent(shareOf(axis, commanded ?? axis.rest));
      // Null says that the axis stays: that is no value that is missing.
      setText(command, commanded === null ? "stays" : figure(axis, commanded));
      setText(feedback, figure(axis, measured));
    },
  };
}

function figure(axis: Axis, value: number | undefined): string {
  return value === undefined ? "–" : figureOf(axis, value).main;
}

function percent(share: number): string {
  return `${(share * 100).toFixed(1)}%`;
}
