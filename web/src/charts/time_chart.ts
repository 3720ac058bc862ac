import uPlot from "uplot";
import type { ChartWindow } from "./chart_ring";
import { gapRange, held, valueRange } from "./chart_scale";
import { h, setText } from "../ui/elements/dom";
import type { ChartBand, ChartLine, ChartSpec } from "./chart_specs";

const SYNC = "lockstep";
const HOLD_ROWS = 5;
const GRID = { stroke: "#27313a", width: 1 };
const TICKS = { stroke: "#4a5763", width: 1, size: 5 };
const AXIS_STROKE = "#c3ced8";
const WHOLE_STEPS = [1, 10, 100, 1000, 10_000, 100_000].flatMap((step) => [step, 2 * step, 5 * step]);
const FONT = "Inter, system-ui, sans-serif";

/** One chart against time, with its name and the values at the cursor, or the newest, above it. */
export class TimeChart {
  readonly element: HTMLElement;
  private readonly plot: uPlot;
  private readonly place = h("div", "chart-plot");
  private readonly readouts: HTMLElement[];
  private readonly columns: readonly (ChartBand | ChartLine)[];

  constructor(
    readonly spec: ChartSpec,
    isLast: boolean,
  ) {
    this.columns = [...spec.bands.flatMap((band) => [band, band]), ...spec.lines];
    this.readouts = spec.lines.map(() => h("span", "chart-figure"));
    const keys = spec.lines.map((line, at) => key(line, this.readouts[at] ?? h("span")));
    const about = spec.unit === "" ? "" : spec.unit;
    const title = h("h3", "chart-title", {}, spec.title, h("span", "chart-unit", {}, about));
    this.element = h("section", "chart", { "aria-label": spec.title, "data-chart": spec.name });
    this.element.append(h("div", "chart-head", {}, title, h("div", "chart-keys", {}, ...keys)), this.place);
    this.plot = new uPlot(
      options(spec, isLast, () => this.read()),
      [[]],
      this.place,
    );
  }

  get canvas(): HTMLCanvasElement {
    return this.plot.ctx.canvas;
  }

  /** Fits the drawing to where it stands. */
  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (width === 0 || height === 0 || (width === this.plot.width && height === this.plot.height)) return;
    this.plot.setSize({ width, height });
  }

  show(window: ChartWindow, from: number, until: number): void {
    const { bands, lines } = this.spec;
    const limits = bands.flatMap((band) => {
      const upper = band.limits(window);
      return [upper, upper.map((limit) => (limit === null ? null : -limit))];
    });
    this.plot.setData(
      [window.time, ...limits, ...lines.map((line) => held(line.values(window), HOLD_ROWS))],
      false,
    );
    this.plot.setScale("x", { min: from, max: until });
    this.read();
  }

  close(): void {
    this.plot.destroy();
  }

  /** The figures beside the names. */
  private read(): void {
    const { idx } = this.plot.cursor;
    for (const [at, readout] of this.readouts.entries()) {
      const values = this.plot.data[1 + this.columns.length - this.spec.lines.length + at] ?? [];
      const value = typeof idx === "number" ? values[idx] : newest(values);
      setText(readout, value === null || value === undefined ? "–" : value.toFixed(this.spec.digits));
    }
  }
}

/** The newest value that is known, unless it is seconds old. */
function newest(values: ArrayLike<number | null | undefined>): number | null {
  for (let back = 1; back <= Math.min(values.length, 10); back++) {
    const value = values[values.length - back];
    if (value !== null && value !== undefined) return value;
  }
  return null;
}

/** A line as it is drawn, its name, and its value. */
function key(line: ChartLine, figure: HTMLElement): HTMLElement {
  const sample = h("canvas", "chart-sample", { width: "56", height: "12", "aria-hidden": "true" });
  const drawing = sample.getContext("2d");
  if (drawing !== null) {
    drawing.strokeStyle = line.stroke;
    drawing.lineWidth = 2 * line.width;
    drawing.setLineDash(line.dash.map((length) => 2 * length));
    drawing.moveTo(0, 6);
    drawing.lineTo(56, 6);
    drawing.stroke();
  }
  return h("span", "chart-key", {}, sample, h("span", "chart-name", {}, line.label), figure);
}

function options(spec: ChartSpec, isLast: boolean, moved: () => void): uPlot.Options {
  const count = spec.bands.length;
  return {
    width: 300,
    height: 100,
    pxAlign: true,
    padding: [8, 28, isLast ? 0 : 6, 0],
    legend: { show: false },
    cursor: { sync: { key: SYNC }, drag: { x: false, y: false }, points: { size: 9 } },
    hooks: { setCursor: [moved] },
    scales: {
      x: { time: true, auto: false },
      y: {
        range: (_plot, low, high) => (count > 0 ? gapRange(low, high) : valueRange(low, high, spec.fromZero)),
      },
    },
    axes: [timeAxis(isLast), valueAxis(spec.digits === 0)],
    series: [{}, ...spec.bands.flatMap(edges), ...spec.lines.map(lineSeries)],
    bands: spec.bands.map((band, at) => ({ series: [1 + 2 * at, 2 + 2 * at], fill: band.fill })),
  };
}

function timeAxis(isLast: boolean): uPlot.Axis {
  const clock = (seconds: number): string => new Date(seconds * 1000).toTimeString().slice(0, 8);
  return {
    stroke: AXIS_STROKE,
    font: `13px ${FONT}`,
    grid: GRID,
    ticks: isLast ? TICKS : { show: false },
    size: isLast ? 28 : 0,
    space: 90,
    values: (_plot, splits) => (isLast ? splits.map(clock) : splits.map(() => "")),
  };
}

function valueAxis(whole: boolean): uPlot.Axis {
  return {
    ...(whole ? { incrs: WHOLE_STEPS } : {}),
    stroke: AXIS_STROKE,
    font: `600 14px ${FONT}`,
    grid: GRID,
    ticks: TICKS,
    size: 62,
    space: 20,
    values: (_plot, splits) =>
      splits.map((value) => value.toLocaleString("en", { maximumFractionDigits: 2 })),
  };
}

function edges(band: ChartBand): uPlot.Series[] {
  const edge: uPlot.Series = {
    stroke: band.stroke,
    width: 1.5,
    dash: [5, 4],
    ...stepped,
    points: { show: false },
  };
  return [edge, edge];
}

function lineSeries(line: ChartLine): uPlot.Series {
  return {
    label: line.label,
    stroke: line.stroke,
    width: line.width,
    dash: [...line.dash],
    ...stepped,
    points: { show: false },
    spanGaps: false,
  };
}

/** Values hold until the next one: what is drawn between two rows was never measured otherwise. */
const stepped: Pick<uPlot.Series, "paths"> =
  uPlot.paths.stepped === undefined ? {} : { paths: uPlot.paths.stepped({ align: 1 }) };
