import { h, milliseconds, setData, setText } from "../ui/elements/dom";
import { CLOCK_LABELS, spanLabel } from "./way_labels";
import type { SpanClock, SpanName, WayPart, WaySummary } from "./way_summary";

const CLOCKS: readonly SpanClock[] = ["bridge", "console", "between", "page"];
const SHADES = 5; // of one clock's colour, in the style sheet

/** A stacked bar of one way, with the figures of its parts below; the order of the bar is the order of the way. */
export class WayFigure {
  readonly element: HTMLElement;
  private readonly total = h("span", "way-total");
  private readonly bar = h("div", "way-bar", { "aria-hidden": "true" });
  private readonly keys = h("div", "way-keys");
  private readonly words = h("p", "way-words");
  private readonly drawn = new Map<SpanName, { segment: HTMLElement; figure: HTMLElement }>();
  private names = "";

  constructor(
    private readonly title: string,
    readonly name: string,
    private readonly about: string, // what the total spans
  ) {
    const heading = h("h3", "chart-title", {}, title);
    this.element = h("section", "way", { "aria-label": title, "data-chart": name });
    this.element.append(h("div", "way-head", {}, heading, this.total), this.bar, this.keys, this.words);
  }

  /** `empty`: why there is nothing to show. `note`: what else a reader has to know; "" for nothing. */
  show(summary: WaySummary | null, empty: string, note: string): void {
    setData(this.element, "empty", String(summary === null));
    if (summary === null) {
      this.rebuild([]);
      setText(this.total, "");
      setText(this.words, empty);
      return;
    }
    this.rebuild(summary.parts);
    setText(this.total, `${milliseconds(summary.totalMs)} ms ${this.about}`);
    const others = summary.parts.map(({ name }) => name);
    for (const part of summary.parts) this.fill(part, others);
    setText(this.words, [slowestWords(summary), note].filter((text) => text !== "").join(" · "));
  }

  private fill({ name, ms, p95Ms }: WayPart, others: readonly SpanName[]): void {
    const parts = this.drawn.get(name);
    if (parts === undefined) return;
    const { label, about } = spanLabel(name, others);
    parts.segment.style.flexGrow = String(Math.max(ms, 0.001));
    parts.segment.title = `${label}: ${milliseconds(ms)} ms, 95 % below ${milliseconds(p95Ms)} ms; ${about}`;
    setText(parts.figure, milliseconds(ms));
  }

  /** Only when other parts were measured: a figure that is read must not jump. */
  private rebuild(parts: readonly WayPart[]): void {
    const others = parts.map(({ name }) => name);
    const names = others.join();
    if (names === this.names) return;
    this.names = names;
    this.drawn.clear();
    const shades = new Map<SpanClock, number>();
    const groups = new Map<SpanClock, HTMLElement>();
    this.bar.replaceChildren();
    for (const { name, clock } of parts) {
      const shade = String((shades.get(clock) ?? 0) % SHADES);
      shades.set(clock, Number(shade) + 1);
      const segment = h("span", "way-part", { "data-clock": clock, "data-shade": shade });
      const figure = h("span", "chart-figure");
      const { label, about } = spanLabel(name, others);
      const swatch = h("span", "way-swatch", { "data-clock": clock, "data-shade": shade });
      const key = h("span", "way-key", { title: about }, swatch, h("span", "chart-name", {}, label), figure);
      this.bar.append(segment);
      this.drawn.set(name, { segment, figure });
      const group = groups.get(clock) ?? h("div", "way-group", { role: "group" });
      if (!groups.has(clock)) group.append(h("span", "way-clock", {}, CLOCK_LABELS[clock]));
      group.append(key);
      groups.set(clock, group);
    }
    this.keys.replaceChildren(...CLOCKS.flatMap((clock) => groups.get(clock) ?? []));
    this.keys.setAttribute("aria-label", `${this.title}: its parts in ms`);
  }
}

function slowestWords({ slowest, count, parts }: WaySummary): string {
  if (slowest === null || count < 2) return "";
  const { label } = spanLabel(
    slowest.name,
    parts.map(({ name }) => name),
  );
  const [total, longest] = [milliseconds(slowest.totalMs), milliseconds(slowest.ms)];
  return `Slowest of ${count}: event ${slowest.event}, ${total} ms, of which ${label} ${longest} ms`;
}
