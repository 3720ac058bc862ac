import { eventGap, isNewer } from "../gate/serial";
import { isRecord } from "../protocol/schema_check";
import { displayText } from "../util/display_text";

/** Where a chunk's events and times are. Times in µs since 1970. */
export interface ReplayChunk {
  readonly firstEvent: number;
  readonly lastEvent: number;
  readonly started: number;
  readonly ended: number;
}

/** `[event, arrived, chunk]`. */
export type ReplayEntry = readonly [number, number, number];

export type MarkKind =
  "contact" | "refusal" | "stop" | "reset" | "seat" | "note" | "fault" | "link" | "action" | "episode";

export interface ReplayMark {
  readonly event: number;
  readonly time: number;
  readonly kind: MarkKind;
  readonly text: string;
}

/** The index of a recording (docs/recording.md, "The index"). */
export interface ReplayIndex {
  readonly epoch: string;
  readonly started: number;
  readonly ended: number;
  readonly firstEvent: number; // 0: no feedback yet
  readonly lastEvent: number;
  readonly topics: readonly string[];
  readonly chunks: readonly ReplayChunk[];
  readonly events: readonly ReplayEntry[];
  readonly keyframes: ReadonlyMap<string, readonly ReplayEntry[]>;
  readonly marks: readonly ReplayMark[];
  readonly lost: number;
}

const KINDS: readonly string[] = [
  "contact",
  "refusal",
  "stop",
  "reset",
  "seat",
  "note",
  "fault",
  "link",
  "action",
  "episode",
];

/** null: it is no index. */
export function parseIndex(value: unknown): ReplayIndex | null {
  if (!isRecord(value) || value["version"] !== 1) return null;
  const topics = listOf(value["topics"]).filter(isRecord);
  const keyframes = isRecord(value["keyframes"]) ? value["keyframes"] : {};
  return {
    epoch: String(value["epoch"]),
    started: numberOf(value["started"]),
    ended: numberOf(value["ended"]),
    firstEvent: numberOf(value["first_event"]),
    lastEvent: numberOf(value["last_event"]),
    topics: topics.map((each) => String(each["topic"])),
    chunks: listOf(value["chunks"]).flatMap(parseChunk),
    events: listOf(value["events"]).filter(isEntry),
    keyframes: new Map(
      Object.entries(keyframes).map(([topic, entries]) => [topic, listOf(entries).filter(isEntry)]),
    ),
    marks: listOf(value["marks"]).flatMap(parseMark),
    lost: numberOf(value["lost"]),
  };
}

/** `more` is what was asked for from chunk `from` on. */
export function grownIndex(index: ReplayIndex, more: ReplayIndex, from: number): ReplayIndex {
  const before = (entry: ReplayEntry): boolean => entry[2] < from;
  const keyframes = new Map(more.keyframes);
  for (const [topic, entries] of index.keyframes)
    keyframes.set(topic, [...entries.filter(before), ...(more.keyframes.get(topic) ?? [])]);
  const known = new Set(more.marks.map((mark) => `${mark.time} ${mark.kind} ${mark.text}`));
  return {
    ...more,
    chunks: [...index.chunks.slice(0, from), ...more.chunks],
    events: [...index.events.filter(before), ...more.events],
    keyframes,
    marks: [
      ...index.marks.filter((mark) => !known.has(`${mark.time} ${mark.kind} ${mark.text}`)),
      ...more.marks,
    ],
  };
}

/** The first and the last chunk that can hold records of `event`; null: the recording is empty. */
export function chunksOf(index: ReplayIndex, event: number): { first: number; last: number } | null {
  const { chunks } = index;
  if (chunks.length === 0) return null;
  const first = chunks.findIndex((chunk) => !isNewer(event, chunk.lastEvent));
  const last = chunks.findLastIndex((chunk) => !isNewer(chunk.firstEvent, event));
  const begin = first === -1 ? chunks.length - 1 : first;
  return { first: begin, last: Math.max(begin, last) };
}

/** The chunk that had begun at `time`, µs. */
export function chunkAt(index: ReplayIndex, time: number): number {
  return Math.max(0, upperBound(index.chunks, (chunk) => chunk.started <= time) - 1);
}

/** The newest keyframe of a camera stamped `event` or earlier that had arrived at `until`, µs. */
export function keyframeBefore(
  index: ReplayIndex,
  topic: string,
  event: number,
  until: number,
): ReplayEntry | null {
  const found = index.keyframes
    .get(topic)
    ?.findLast((entry) => entry[1] <= until && !isNewer(entry[0], event));
  return found ?? null;
}

/** How far `event` is into the recording, in events. */
export function offsetOf(index: ReplayIndex, event: number): number {
  return eventGap(event, index.firstEvent);
}

/** The event that is in the recording and closest to `event`. */
export function clampedEvent(index: ReplayIndex, event: number): number {
  if (!isNewer(event, index.firstEvent)) return index.firstEvent;
  return isNewer(event, index.lastEvent) ? index.lastEvent : event;
}

/** About when `event` came, µs: exact to a tenth of a second. */
export function timeOf(index: ReplayIndex, event: number): number {
  const found = index.events.findLast((entry) => !isNewer(entry[0], event));
  return found?.[1] ?? index.started;
}

function upperBound<T>(items: readonly T[], holds: (item: T) => boolean): number {
  let [low, high] = [0, items.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    const item = items[middle];
    if (item !== undefined && holds(item)) low = middle + 1;
    else high = middle;
  }
  return low;
}

function parseChunk(value: unknown): ReplayChunk[] {
  if (!Array.isArray(value) || value.length < 5) return [];
  const [, firstEvent, lastEvent, started, ended] = value.map(numberOf);
  return [
    { firstEvent: firstEvent ?? 0, lastEvent: lastEvent ?? 0, started: started ?? 0, ended: ended ?? 0 },
  ];
}

function parseMark(value: unknown): ReplayMark[] {
  if (!isRecord(value) || typeof value["kind"] !== "string" || !KINDS.includes(value["kind"])) return [];
  return [
    {
      event: numberOf(value["event"]),
      time: numberOf(value["time"]),
      kind: value["kind"] as MarkKind,
      text: displayText(value["text"]),
    },
  ];
}

function isEntry(value: unknown): value is ReplayEntry {
  return Array.isArray(value) && value.length === 3 && value.every((each) => typeof each === "number");
}

function listOf(value: unknown): unknown[] {
  return Array.isArray(value) ? (value as unknown[]) : [];
}

function numberOf(value: unknown): number {
  return typeof value === "number" && Number.isFinite(value) ? value : 0;
}
