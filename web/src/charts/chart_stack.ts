import "uplot/dist/uPlot.min.css";
import { chartWindow, type ChartRing } from "./chart_ring";
import { h } from "../ui/elements/dom";
import { chartSpecs } from "./chart_specs";
import { TimeChart } from "./time_chart";
import { WayFigures, type WaySource } from "./way_figures";

/** All charts, one above the other, over the same time. */
export class ChartStack {
  readonly element = h("div", "chart-stack");
  private charts: TimeChart[] = [];
  private readonly ways: WayFigures;
  private streams = "";

  constructor(
    private readonly ring: ChartRing,
    ways: WaySource,
  ) {
    this.ways = new WayFigures(ways);
    this.build();
  }

  /** Draws the rows from `from` to `until`, s since 1970. */
  show(from: number, until: number): void {
    if ([...this.ring.streams.keys()].join() !== this.streams) this.build();
    this.ways.show(from, until);
    const window = chartWindow(this.ring, from, until);
    for (const chart of this.charts) {
      chart.resize();
      chart.show(window, from, until);
    }
  }

  /** Those that are drawn, for a picture of them. */
  all(): readonly TimeChart[] {
    return this.charts;
  }

  close(): void {
    for (const chart of this.charts) chart.close();
    this.charts = [];
    this.element.replaceChildren();
  }

  private build(): void {
    this.close();
    const streams = [...this.ring.streams.values()];
    this.streams = streams.map((stream) => stream.name).join();
    const specs = chartSpecs(streams);
    this.charts = specs.map((spec, at) => new TimeChart(spec, at === specs.length - 1));
    this.element.append(this.ways.element, ...this.charts.map((chart) => chart.element));
  }
}
