import { COMMAND_WAY, PICTURE_WAY } from "../protocol/ways";
import { createSamples, quantile } from "../util/samples";
import type { TraceBook, TracedCommand, TracedPicture } from "../engine/trace_book";

export type SpanName = (typeof COMMAND_WAY)[number]["name"] | (typeof PICTURE_WAY)[number]["name"];
export type SpanClock = (typeof PICTURE_WAY)[number]["clock"];

/** One part of a stacked bar. */
export interface WayPart {
  readonly name: SpanName;
  readonly clock: SpanClock; // on whose clock it was measured; "between": what is left between clocks
  readonly medianMs: number;
  readonly p95Ms: number;
}

/** The one that took longest, and its longest part. */
export interface SlowestWay {
  readonly event: number;
  readonly totalMs: number;
  readonly name: SpanName;
  readonly ms: number;
}

/** A stacked bar: medians of each part over some seconds. */
export interface WaySummary {
  readonly count: number;
  readonly parts: readonly WayPart[]; // in the order of the way; only those that were measured
  readonly totalMs: number; // of the parts
  readonly slowest: SlowestWay | null;
  readonly hasRemainder: boolean;
}

interface Traced {
  readonly event: number;
  readonly spans: Readonly<Partial<Record<SpanName, number>>>;
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

/** The cameras of the pictures that were traced, those seen last first. */
export function tracedStreams(book: TraceBook, fromMs: number): string[] {
  return [...new Set(book.pictures.newest(({ atMs }) => atMs >= fromMs).map(({ stream }) => stream))];
}

function summaryOf(way: Way, traced: readonly Traced[]): WaySummary | null {
  if (traced.length === 0) return null;
  const parts = way.flatMap(({ name, clock }) => {
    const samples = createSamples(traced.length);
    for (const { spans } of traced) if (spans[name] !== undefined) samples.values.push(spans[name]);
    const [medianMs, p95Ms] = [quantile(samples, 0.5), quantile(samples, 0.95)];
    return medianMs === null || p95Ms === null ? [] : [{ name, clock, medianMs, p95Ms }];
  });
  return {
    count: traced.length,
    parts,
    totalMs: parts.reduce((sum, { medianMs }) => sum + medianMs, 0),
    slowest: slowestOf(way, traced),
    hasRemainder: parts.some(({ clock }) => clock === "between"),
  };
}

function slowestOf(way: Way, traced: readonly Traced[]): SlowestWay | null {
  let slowest: SlowestWay | null = null;
  for (const { event, spans } of traced) {
    const parts = way.flatMap(({ name }) => {
      const ms = spans[name];
      return ms === undefined ? [] : [{ name, ms }];
    });
    const totalMs = parts.reduce((sum, { ms }) => sum + ms, 0);
    const longest = parts.toSorted((left, right) => right.ms - left.ms)[0];
    if (longest !== undefined && totalMs > (slowest?.totalMs ?? -1))
      slowest = { event, totalMs, name: longest.name, ms: longest.ms };
  }
  return slowest;
}
