import type { ReplayIndex, ReplayMark } from "../index_table";
import { countMarks, GROUP_NAMES, groupOf, MARK_GROUPS, markName, markLabel, type MarkGroup } from "../marks";
import { elapsed } from "../../session/recording_labels";
import { button, grouped, h, setHidden, setPressed, setText } from "../../ui/elements/dom";
import { MARK_COLOURS } from "./timeline";

const MOST_ROWS = 300;

/** What happened, to jump to; which kinds are shown is chosen here, for the timeline too. */
export class MarkList {
  readonly element = h("section", "card marks", { "aria-label": "What happened" });
  shown: readonly ReplayMark[] = [];
  private readonly hidden = new Set<MarkGroup>();
  private readonly rows = h("ol", "mark-rows");
  private readonly note = h("p", "card-note");
  private readonly filters = new Map<MarkGroup, HTMLButtonElement>();
  private drawn: readonly ReplayMark[] | null = null;

  constructor(
    private readonly seek: (mark: ReplayMark) => void,
    private readonly changed: () => void,
  ) {
    for (const group of MARK_GROUPS) {
      const filter = button("mark-filter", "", () => this.toggle(group));
      filter.style.setProperty("--mark", MARK_COLOURS[group]);
      this.filters.set(group, filter);
    }
    const filters = h(
      "div",
      "mark-filters",
      { role: "group", "aria-label": "Kinds" },
      ...this.filters.values(),
    );
    this.element.append(
      h("div", "card-head", {}, h("h2", "", {}, "What happened")),
      filters,
      this.note,
      this.rows,
    );
  }

  update(index: ReplayIndex, time: number): void {
    if (this.drawn !== index.marks) this.draw(index);
    const at = this.shown.findLastIndex((mark) => mark.time <= time);
    for (const [number, row] of [...this.rows.children].entries())
      row.classList.toggle("is-here", number === at);
  }

  private draw(index: ReplayIndex): void {
    this.drawn = index.marks;
    const counts = countMarks(index.marks);
    for (const [group, filter] of this.filters) {
      setText(filter, `${GROUP_NAMES[group]} ${counts[group]}`);
      setPressed(filter, !this.hidden.has(group));
      setHidden(filter, counts[group] === 0);
    }
    this.shown = index.marks.filter((mark) => !this.hidden.has(groupOf(mark)));
    const left = this.shown.length - MOST_ROWS;
    const words = index.marks.length === 0 ? "No contact, refusal, stop or hand-over was recorded." : "";
    setText(
      this.note,
      left > 0 ? `The first ${MOST_ROWS} of ${this.shown.length}; the timeline has all` : words,
    );
    setHidden(this.note, this.note.textContent === "");
    this.rows.replaceChildren(...this.shown.slice(0, MOST_ROWS).map((mark) => this.row(index, mark)));
  }

  private row(index: ReplayIndex, mark: ReplayMark): HTMLElement {
    const open = button("mark-row", "", () => this.seek(mark));
    open.style.setProperty("--mark", MARK_COLOURS[groupOf(mark)]);
    open.append(
      h("span", "mark-time", {}, elapsed((mark.time - index.started) / 1e6)),
      h("span", "mark-text", {}, h("b", "", {}, markName(mark)), ` ${markLabel(mark)}`),
      h("span", "mark-event", {}, grouped(mark.event)),
    );
    return h("li", "", {}, open);
  }

  private toggle(group: MarkGroup): void {
    if (!this.hidden.delete(group)) this.hidden.add(group);
    this.drawn = null;
    this.changed();
  }
}
