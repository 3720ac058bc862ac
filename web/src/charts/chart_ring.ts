/** What the charts need of one stream at one moment. */
export interface StreamPoint {
  readonly name: string; // "overview"
  readonly label: string; // "Overview"
  readonly kind: "audio" | "video";
  readonly stamp: number | null; // of the newest rendering
  readonly gap: number | null; // the largest since the row before, by size; null: nothing was rendered
  readonly tolerance: number;
}

/** One row: the page's state at one moment. Null where nothing is known, so that a chart shows a hole. */
export interface ChartRow {
  readonly wallMs: number; // since 1970, of a clock that is never set
  readonly epoch: string; // "" before the session told it: feedback and pictures may come a little earlier
  readonly event: number | null;
  readonly eventRate: number | null; // 1/s
  readonly pictureDelayMs: number | null; // command to picture, measured since the row before
  readonly roundTripMs: number | null;
  readonly streams: readonly StreamPoint[];
}

export interface ChartStream {
  readonly name: string;
  readonly label: string;
  readonly kind: "audio" | "video";
}

/** The newest rows, column by column; what is older is overwritten. */
export interface ChartRing {
  readonly capacity: number; // 6000: ten minutes at ten rows a second
  readonly columns: Map<string, Float64Array>; // by `COLUMNS` or `streamColumn`; NaN where nothing is known
  readonly streams: Map<string, ChartStream>;
  readonly epochs: string[]; // newest last
  next: number; // where the next row goes
  count: number; // rows in it
}

/** A run of rows, oldest first, as the charts take them. */
export interface ChartWindow {
  readonly time: number[]; // s since 1970
  readonly streams: readonly ChartStream[];
  column(name: string): (number | null)[];
  epochs(): string[];
}

export const COLUMNS = ["event", "event_rate", "picture_delay_ms", "round_trip_ms"] as const;
export const STREAM_COLUMNS = ["stamp", "gap", "tolerance"] as const;

const TIME = "time";
const EPOCH = "epoch";
const STREAM_LIMIT = 8;
const EPOCH_LIMIT = 64;

export function streamColumn(stream: string, column: (typeof STREAM_COLUMNS)[number]): string {
  return `${stream}_${column}`;
}

export function createChartRing(capacity = 6000): ChartRing {
  const ring: ChartRing = {
    capacity,
    columns: new Map(),
    streams: new Map(),
    epochs: [],
    next: 0,
    count: 0,
  };
  for (const name of [TIME, EPOCH, ...COLUMNS]) addColumn(ring, name);
  return ring;
}

export function addRow(ring: ChartRing, row: ChartRow): void {
  const at = ring.next;
  for (const column of ring.columns.values()) column[at] = NaN;
  set(ring, TIME, at, row.wallMs / 1000);
  set(ring, EPOCH, at, epochNumber(ring, row.epoch));
  const epochKnown = row.epoch !== ""; // an event reference says nothing without it
  set(ring, "event", at, epochKnown ? row.event : null);
  set(ring, "event_rate", at, row.eventRate);
  set(ring, "picture_delay_ms", at, row.pictureDelayMs);
  set(ring, "round_trip_ms", at, row.roundTripMs);
  for (const point of row.streams) setStream(ring, at, epochKnown ? point : { ...point, stamp: null });
  ring.next = (at + 1) % ring.capacity;
  ring.count = Math.min(ring.capacity, ring.count + 1);
}

/** The newest row's time, s since 1970; null before the first. */
export function newestTime(ring: ChartRing): number | null {
  return ring.count === 0 ? null : (columnOf(ring, TIME)[place(ring, ring.count - 1)] ?? null);
}

/** The rows from `from` to `until`, s since 1970, both included. It reads the ring: use it before the next row. */
export function chartWindow(ring: ChartRing, from: number, until: number): ChartWindow {
  const times = columnOf(ring, TIME);
  const at = (index: number): number => times[place(ring, index)] ?? NaN;
  const first = lowest(ring.count, (index) => at(index) >= from);
  const end = lowest(ring.count, (index) => at(index) > until);
  const places = Array.from({ length: Math.max(0, end - first) }, (_, index) => place(ring, first + index));
  const read = (name: string): (number | null)[] => {
    const column = ring.columns.get(name);
    return places.map((index) => known(column?.[index]));
  };
  return {
    time: places.map((index) => times[index] ?? NaN),
    streams: [...ring.streams.values()],
    column: read,
    epochs: () => read(EPOCH).map((number) => (number === null ? "" : (ring.epochs[number] ?? ""))),
  };
}

function known(value: number | undefined): number | null {
  return value === undefined || Number.isNaN(value) ? null : value;
}

function setStream(ring: ChartRing, at: number, point: StreamPoint): void {
  if (!ring.streams.has(point.name)) {
    if (ring.streams.size === STREAM_LIMIT) return;
    ring.streams.set(point.name, { name: point.name, label: point.label, kind: point.kind });
    for (const column of STREAM_COLUMNS) addColumn(ring, streamColumn(point.name, column));
  }
  for (const column of STREAM_COLUMNS) set(ring, streamColumn(point.name, column), at, point[column]);
}

function set(ring: ChartRing, name: string, at: number, value: number | null): void {
  columnOf(ring, name)[at] = value ?? NaN;
}

function columnOf(ring: ChartRing, name: string): Float64Array {
  return ring.columns.get(name) ?? addColumn(ring, name);
}

function addColumn(ring: ChartRing, name: string): Float64Array {
  const column = new Float64Array(ring.capacity).fill(NaN);
  ring.columns.set(name, column);
  return column;
}

/** Epochs are kept by number; rows of one that is forgotten are long overwritten, or there were very many. */
function epochNumber(ring: ChartRing, epoch: string): number {
  const { epochs } = ring;
  if (epochs.at(-1) !== epoch && epochs.length < EPOCH_LIMIT) epochs.push(epoch);
  return epochs.lastIndexOf(epoch);
}

/** Where the `index`th oldest row stands. */
function place(ring: ChartRing, index: number): number {
  return (ring.next - ring.count + index + ring.capacity) % ring.capacity;
}

/** The first index for which `holds`, which once true stays true; `count` when it never is. */
function lowest(count: number, holds: (index: number) => boolean): number {
  let low = 0;
  let high = count;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (holds(middle)) high = middle;
    else low = middle + 1;
  }
  return low;
}
