import { quantile, rateOf } from "../../util/samples";
import type { ConsoleEngine } from "../../engine/console_engine";
import { h, milliseconds, setText, type Panel } from "../elements/dom";

/** Delays on this page's own clock, and rates. */
export function createDelayPanel(engine: ConsoleEngine, mainStream: () => string | null): Panel {
  const picture = createFigure("Command to picture", "ms");
  const feedback = createFigure("Command to feedback", "ms");
  const trip = createFigure("Round trip", "ms");
  const frames = createFigure("Pictures", "/s");
  const figures = [picture, feedback, trip, frames].map((figure) => figure.element);
  return {
    element: h("section", "card figures", { "aria-label": "Delays" }, ...figures),
    update(now) {
      const latency = engine.driving.driver?.latency;
      const main = engine.streams.videos.get(mainStream() ?? "");
      picture.show(milliseconds(latency === undefined ? null : quantile(latency.toPicture, 0.5)));
      feedback.show(milliseconds(latency === undefined ? null : quantile(latency.toFeedback, 0.5)));
      trip.show(milliseconds(engine.hears(now) ? engine.state.roundTripMs : null));
      frames.show(main === undefined ? "–" : rateOf(main.frames, now).toFixed(0));
    },
  };
}

function createFigure(label: string, unit: string): { element: HTMLElement; show(value: string): void } {
  const value = h("span", "figure-value", {}, "–");
  const element = h(
    "div",
    "figure",
    {},
    h("span", "figure-label", {}, label),
    h("span", "figure-line", {}, value, h("span", "figure-unit", {}, unit)),
  );
  return { element, show: (text) => setText(value, text) };
}
