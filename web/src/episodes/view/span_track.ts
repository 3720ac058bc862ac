import type { Episode } from "../episode_list";
import { eventAt, eventFrom, isTrimmed, moved, spanOf, type Handle, type Span } from "../episode_span";
import { eventGap } from "../../gate/serial";
import { h, setText } from "../../ui/elements/dom";

const LABELS: Readonly<Record<Handle, string>> = {
  first: "First event",
  cursor: "Event to look at",
  last: "Last event",
};

/** The stretch of an episode with its two ends and a cursor between: sliders, and a number for each. */
export class SpanTrack {
  readonly element: HTMLElement;
  private readonly sliders = new Map<Handle, HTMLInputElement>();
  private readonly numbers = new Map<Handle, HTMLInputElement>();
  private readonly length = h("span", "span-length", { role: "status" });
  private readonly rail = h("div", "span-rail");
  private span: Span;

  constructor(
    private readonly episode: Episode,
    mayTrim: boolean,
    private readonly changed: (span: Span) => void,
  ) {
    this.span = spanOf(episode);
    const handles: readonly Handle[] = mayTrim ? ["first", "cursor", "last"] : ["cursor"];
    for (const handle of handles) {
      const slider = h("input", `span-slider ${handle}`, {
        type: "range",
        min: "0",
        max: String(this.span.length),
        step: "1",
        "aria-label": LABELS[handle],
      });
      slider.addEventListener("input", () => this.move(handle, slider.valueAsNumber));
      this.sliders.set(handle, slider);
      const number = h("input", "field span-number", {
        type: "number",
        inputmode: "numeric",
        "aria-label": `${LABELS[handle]}, as a number`,
      });
      number.addEventListener("change", () => this.moveTo(handle, number.valueAsNumber));
      this.numbers.set(handle, number);
    }
    const kept = h("span", "span-kept", { "aria-hidden": "true" });
    this.rail.append(kept, ...this.sliders.values());
    const fields = [...this.numbers].map(([handle, number]) =>
      h("label", `span-field ${handle}`, {}, h("span", "form-label", {}, LABELS[handle]), number),
    );
    this.element = h("div", "span", {}, this.rail, h("div", "span-fields", {}, ...fields), this.length);
    this.draw();
  }

  get value(): Span {
    return this.span;
  }

  get isTrimmed(): boolean {
    return isTrimmed(this.span, this.episode);
  }

  reset(): void {
    this.set(spanOf(this.episode));
  }

  private moveTo(handle: Handle, event: number): void {
    if (Number.isInteger(event)) this.move(handle, eventGap(event, this.episode.firstBound));
    else this.draw();
  }

  private move(handle: Handle, to: number): void {
    this.set(moved(this.span, handle, to));
  }

  private set(span: Span): void {
    this.span = span;
    this.draw();
    this.changed(span);
  }

  private draw(): void {
    const { span, episode } = this;
    for (const [handle, slider] of this.sliders) {
      const value = String(span[handle]);
      if (slider.value !== value) slider.value = value;
      slider.setAttribute("aria-valuetext", `Event ${eventAt(episode, span, handle)}`);
    }
    for (const [handle, number] of this.numbers) {
      number.min = String(episode.firstBound);
      number.max = String(eventFrom(episode.firstBound, span.length));
      number.value = String(eventAt(episode, span, handle));
    }
    this.rail.style.setProperty("--first", String(span.first / span.length));
    this.rail.style.setProperty("--last", String(span.last / span.length));
    const whole = span.first === 0 && span.last === span.length;
    const of = whole ? "" : ` of the ${span.length} that can be had`;
    setText(this.length, `${span.last - span.first} events${of}`);
  }
}
