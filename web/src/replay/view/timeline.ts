import type { ReplayMark, ReplayIndex } from "../index_table";
import { offsetOf } from "../index_table";
import { groupOf, MARK_GROUPS, type MarkGroup } from "../marks";
import { eventGap, MAX_EVENT } from "../../gate/serial";
import { grouped, h } from "../../ui/elements/dom";

const LANE = 9; // CSS pixels
export const MARK_COLOURS: Readonly<Record<MarkGroup, string>> = {
  contacts: "#f0a830",
  refusals: "#cc79a7",
  stops: "#ff7a70",
  seats: "#56b4e9",
  episodes: "#3fbf9b",
  others: "#a3b2c0",
};

export interface TimelineState {
  readonly index: ReplayIndex;
  readonly event: number;
  readonly marks: readonly ReplayMark[]; // those to draw
  readonly loop: { readonly from: number; readonly to: number } | null;
}

/** The whole recording from its first to its last event, with its marks in lanes; dragged to seek. */
export class Timeline {
  readonly element = h("div", "timeline", {
    role: "slider",
    tabindex: "0",
    "aria-label": "Event",
    "aria-orientation": "horizontal",
  });
  private readonly canvas = h("canvas", "timeline-marks", { "aria-hidden": "true" });
  private readonly played = h("span", "timeline-played");
  private readonly loop = h("span", "timeline-loop");
  private readonly head = h("span", "timeline-head");
  private readonly hint = h("span", "timeline-hint");
  private state: TimelineState | null = null;
  private drawn: unknown[] = [];

  constructor(private readonly seek: (event: number) => void) {
    const track = h("span", "timeline-track", {}, this.played, this.loop);
    this.element.append(this.canvas, track, this.head, this.hint);
    this.hint.hidden = true;
    this.element.addEventListener("pointerdown", (event) => {
      this.element.setPointerCapture(event.pointerId);
      this.seekTo(event);
    });
    this.element.addEventListener("pointermove", (event) => {
      this.showHint(event);
      if (this.element.hasPointerCapture(event.pointerId)) this.seekTo(event);
    });
    this.element.addEventListener("pointerleave", () => (this.hint.hidden = true));
  }

  update(state: TimelineState): void {
    this.state = state;
    const { index, event, loop } = state;
    const at = percent(index, event);
    this.head.style.left = at;
    this.played.style.width = at;
    this.loop.hidden = loop === null;
    if (loop !== null) {
      this.loop.style.left = percent(index, loop.from);
      this.loop.style.right = `calc(100% - ${percent(index, loop.to)})`;
    }
    this.element.setAttribute("aria-valuemin", String(index.firstEvent));
    this.element.setAttribute("aria-valuemax", String(index.lastEvent));
    this.element.setAttribute("aria-valuenow", String(event));
    this.element.setAttribute("aria-valuetext", `Event ${event}`);
    const { clientWidth: width } = this.canvas;
    const inputs = [state.marks, index.lastEvent, index.firstEvent, width];
    if (inputs.some((input, each) => input !== this.drawn[each])) this.drawMarks(state);
    this.drawn = inputs;
  }

  private drawMarks({ index, marks }: TimelineState): void {
    const { canvas } = this;
    const scale = devicePixelRatio;
    const height = LANE * MARK_GROUPS.length;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * scale));
    canvas.height = Math.round(height * scale);
    const drawing = canvas.getContext("2d");
    if (drawing === null) return;
    drawing.scale(scale, scale);
    for (const mark of marks) {
      const group = groupOf(mark);
      drawing.fillStyle = MARK_COLOURS[group];
      const x = share(index, mark.event) * canvas.clientWidth;
      drawing.fillRect(
        Math.min(canvas.clientWidth - 2, Math.max(0, x - 1)),
        MARK_GROUPS.indexOf(group) * LANE,
        2,
        LANE - 2,
      );
    }
  }

  private eventAt(pointer: PointerEvent): number | null {
    const { state } = this;
    if (state === null || state.index.lastEvent === 0) return null;
    const { left, width } = this.element.getBoundingClientRect();
    const along = Math.min(1, Math.max(0, (pointer.clientX - left) / (width || 1)));
    const length = eventGap(state.index.lastEvent, state.index.firstEvent);
    return ((state.index.firstEvent - 1 + Math.round(along * length)) % MAX_EVENT) + 1;
  }

  private seekTo(pointer: PointerEvent): void {
    const event = this.eventAt(pointer);
    if (event !== null) this.seek(event);
  }

  private showHint(pointer: PointerEvent): void {
    const event = this.eventAt(pointer);
    this.hint.hidden = event === null || pointer.pointerType === "touch";
    if (event === null || this.state === null) return;
    this.hint.textContent = grouped(event);
    this.hint.style.left = percent(this.state.index, event);
  }
}

function share(index: ReplayIndex, event: number): number {
  const length = eventGap(index.lastEvent, index.firstEvent);
  return length <= 0 ? 0 : Math.min(1, Math.max(0, offsetOf(index, event) / length));
}

function percent(index: ReplayIndex, event: number): string {
  return `${(100 * share(index, event)).toFixed(3)}%`;
}
