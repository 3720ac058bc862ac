import { quantity, scaleFor } from "../../util/units";
import type { Axis, RobotDescription } from "../../protocol/wire";
import { h, setText } from "../../ui/elements/dom";

interface AxisRow {
  readonly element: HTMLElement;
  show(commanded: number | undefined, measured: number | undefined): void;
}

/** Each axis as commanded and as measured, in figures and as a bar. */
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
  show(commanded: readonly number[], measured: readonly number[], unknown: ReadonlySet<number>): void {
    for (const [at, row] of this.rows.entries())
      row.show(commanded[at], unknown.has(at) ? undefined : measured[at]);
  }
}

function createRow(axis: Axis): AxisRow {
  const command = h("span", "axis-figure");
  const feedback = h("span", "axis-figure");
  const fill = h("span", "axis-fill");
  const mark = h("span", "axis-mark");
  const track = h("span", "axis-track", { "aria-hidden": "true" }, fill, mark);
  const share = (amount: number): number =>
    Math.min(1, Math.max(0, (amount - axis.minimum) / (axis.maximum - axis.minimum || 1)));
  const middle = share(axis.rest);
  const scale = scaleFor(axis.unit, Math.max(Math.abs(axis.minimum), Math.abs(axis.maximum)));
  return {
    element: h(
      "div",
      "axis-row",
      { "data-axis": axis.name },
      h("span", "axis-label", {}, axis.label),
      command,
      feedback,
      track,
    ),
    show(commanded, measured) {
      const at = share(measured ?? axis.rest);
      fill.style.left = percent(Math.min(at, middle));
      fill.style.width = percent(Math.abs(at - middle));
      mark.hidden = commanded === undefined;
      mark.style.left = percent(share(commanded ?? axis.rest));
      setText(command, commanded === undefined ? "–" : quantity(commanded, scale));
      setText(feedback, measured === undefined ? "–" : quantity(measured, scale));
    },
  };
}

function percent(share: number): string {
  return `${(share * 100).toFixed(1)}%`;
}
