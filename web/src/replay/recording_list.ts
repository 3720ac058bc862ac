import { isRecord } from "../protocol/schema_check";
import { displayText } from "../util/display_text";

/** One file of the list (docs/recording.md). Times in µs since 1970. */
export interface RecordingEntry {
  readonly id: string;
  readonly recording: string; // common to all parts
  readonly part: number;
  readonly name: string; // "" when nobody named it
  readonly robot: string; // its label
  readonly by: string;
  readonly started: number;
  readonly ended: number;
  readonly firstEvent: number;
  readonly lastEvent: number;
  readonly bytes: number;
  readonly marks: ReadonlyMap<string, number>; // how many of each kind
  readonly episodes: ReadonlyMap<string, number>; // how many in each state: "kept", "discarded", "cut", "open"
  readonly lost: number;
  readonly running: boolean;
  readonly interrupted: boolean;
}

export interface RecordingList {
  readonly recordings: readonly RecordingEntry[];
  readonly older: number; // that were left out behind these
}

export function parseList(value: unknown): RecordingList {
  const list =
    isRecord(value) && Array.isArray(value["recordings"]) ? (value["recordings"] as unknown[]) : [];
  const older = isRecord(value) && typeof value["older"] === "number" ? value["older"] : 0;
  return { recordings: list.map(parseEntry).filter((entry) => entry !== null), older };
}

/** `list`, and of `beyond` what is older than all of it. */
export function joined(list: RecordingList, beyond: RecordingList | null): RecordingList {
  const last = list.recordings.at(-1);
  if (beyond === null || list.older === 0 || last === undefined) return list;
  const rest = beyond.recordings.filter((entry) => entry.started < last.started);
  return { recordings: [...list.recordings, ...rest], older: beyond.older };
}

/** null: it is none. */
export function parseEntry(value: unknown): RecordingEntry | null {
  if (!isRecord(value) || typeof value["id"] !== "string" || value["id"] === "") return null;
  const text = (name: string): string => displayText(value[name]);
  const number = (name: string): number => (typeof value[name] === "number" ? value[name] : 0);
  const counts = (name: string): Map<string, number> => {
    const found = isRecord(value[name]) ? Object.entries(value[name]) : [];
    return new Map(found.flatMap(([kind, count]) => (typeof count === "number" ? [[kind, count]] : [])));
  };
  return {
    id: value["id"],
    recording: text("recording"),
    part: number("part"),
    name: text("name"),
    robot: text("robot"),
    by: text("by"),
    started: number("started"),
    ended: number("ended"),
    firstEvent: number("first_event"),
    lastEvent: number("last_event"),
    bytes: number("bytes"),
    marks: counts("marks"),
    episodes: counts("episodes"),
    lost: number("lost"),
    running: value["running"] === true,
    interrupted: value["interrupted"] === true,
  };
}

/** Those in which every word of `query` occurs: in the name, the robot, the id, who started it or the day. */
export function searched(entries: readonly RecordingEntry[], query: string): RecordingEntry[] {
  const words = query.toLowerCase().split(/\s+/).filter(Boolean);
  return entries.filter((entry) => {
    const marks = [...entry.marks.keys()].join(" ");
    const text = `${entry.name} ${entry.robot} ${entry.id} ${entry.by} ${dayLabel(entry.started)} ${marks}`;
    return words.every((word) => text.toLowerCase().includes(word));
  });
}

/** "21 Nov 2026, 17:38". */
export function dayLabel(time: number): string {
  const date = new Date(time / 1000);
  const day = date.toLocaleDateString("en-GB", { day: "numeric", month: "short", year: "numeric" });
  return `${day}, ${date.toTimeString().slice(0, 5)}`;
}

export function sizeLabel(bytes: number): string {
  if (bytes < 1e6) return `${Math.ceil(bytes / 1e3)} kB`;
  return bytes < 1e9 ? `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB` : `${(bytes / 1e9).toFixed(1)} GB`;
}
