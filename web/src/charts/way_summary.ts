import { COMMAND_WAY, PICTURE_WAY } from "../protocol/ways";
import { quantile } from "../util/samples";
import { sumOfSpans } from "../util/span_values";
import type { TraceBook, TracedCommand, TracedPicture } from "../engine/trace_book";

export type SpanName = (typeof COMMAND_WAY)[number]["name"] | (typeof PICTURE_WAY)[number]["name"];
export type SpanClock = (typeof PICTURE_WAY)[number]["clock"];

/** One part of a stacked bar. */
export interface WayPart {
  readonly name: SpanName;
  readonly clock: SpanClock; // on whose clock it was measured; "between": what is left between clocks
  readonly ms: number; // mean of the middle half
  readonly p95Ms: number; // of all
}

/** The one that took longest, and its longest part. */
export interface SlowestWay {
  readonly event: number;
  readonly totalMs: number;
  readonly name: SpanName;
  readonly ms: number;
}

/**
 * A stacked bar: the mean of each part over the middle half, by their total, of all that was traced in some seconds. So
 * the parts add up to what is usual; medians of parts would not.
 */
export interface WaySummary {
  readonly count: number;
  readonly parts: readonly WayPart[]; // in the order of the way; only those that were measured
  readonly totalMs: number; // of the parts
  readonly slowest: SlowestWay | null;
  readonly hasRemainder: boolean;
}

interface Traced {
  readonly event: number;
  readonly spans: { readonly [name in SpanName]?: number };
}

type Way = readonly { readonly name: SpanName; readonly clock: SpanClock }[];

/** The wait for the camera's next picture comes before the capture; it is no part of the way from there. */
const FROM_CAPTURE = PICTURE_WAY.filter(({ name }) => name !== "camera_wait_ms");

/** One camera's pictures that were drawn from `fromMs` to `untilMs`, performance.now(). */
export function pictureSummary(
  book: TraceBook,
  stream: string,
  fromMs: number,
  untilMs: number,
): WaySummary | null {
  const within = (picture: TracedPicture): boolean =>
    picture.stream === stream && picture.atMs <= untilMs && picture.atMs >= fromMs;
  const found = book.pictures.newest(({ atMs }) => atMs >= fromMs).filter(within);
  return summaryOf(
    FROM_CAPTURE,
    found.map(({ stamp, spans }) => ({ event: stamp, spans })),
  );
}

export function commandSummary(book: TraceBook, fromMs: number, untilMs: number): WaySummary | null {
  const found = book.commands.newest(({ atMs }) => atMs >= fromMs);
  return summaryOf(
    COMMAND_WAY,
    found.filter((command: TracedCommand) => command.atMs <= untilMs),
  );
}

function summaryOf(way: Way, all: readonly Traced[]): WaySummary | null {
  const hasRemainder = all.some(({ spans }) => spans.between_ms !== undefined);
  // Without it a way is shorter for want of a part; where some have it, the others say nothing of the whole.
  const traced = hasRemainder ? all.filter(({ spans }) => spans.between_ms !== undefined) : all;
  if (traced.length === 0) return null;
  const names = way.map(({ name }) => name);
  const ordered = traced
    .map(({ event, spans }) => ({ event, spans, totalMs: sumOfSpans(spans, names) }))
    .toSorted((left, right) => left.totalMs - right.totalMs);
  const quarter = Math.floor(ordered.length / 4);
  const middle = ordered.slice(quarter, ordered.length - quarter);
  const parts = way.flatMap(({ name, clock }) => {
    const values = ordered.flatMap(({ spans }) => spans[name] ?? []);
    const p95Ms = quantile({ limit: values.length, values }, 0.95);
    return p95Ms === null ? [] : [{ name, clock, ms: meanOf(middle, name), p95Ms }];
  });
  return {
    count: ordered.length,
    parts,
    totalMs: parts.reduce((sum, { ms }) => sum + ms, 0),
    slowest: slowestOf(way, ordered.at(-1)),
    hasRemainder,
  };
}

/** What was not measured in one took no time there: a command that carries no change of the input has not waited. */
function meanOf(traced: readonly Traced[], name: SpanName): number {
  return traced.reduce((sum, { spans }) => sum + (spans[name] ?? 0), 0) / traced.length;
}

function slowestOf(
  way: Way,
  slowest: (Traced & { readonly totalMs: number }) | undefined,
): SlowestWay | null {
  if (slowest === undefined) return null;
  const { event, spans, totalMs } = slowest;
  const longest = way
    .flatMap(({ name }) => (spans[name] === undefined ? [] : [{ name, ms: spans[name] }]))
    .toSorted((left, right) => right.ms - left.ms)[0];
  return longest === undefined ? null : { event, totalMs, ...longest };
}
