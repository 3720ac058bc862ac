import { isRecord } from "../protocol/schema_check";
import { displayText } from "../util/display_text";

/** One record. Times in µs since 1970. */
export interface ReplayRecord {
  readonly id: number; // counts through the whole recording: order of arrival
  readonly topic: string;
  readonly event: number;
  readonly arrived: number;
  readonly captured: number;
  readonly keyframe: boolean;
  readonly format: string; // of a picture: "h264", "vp8"; of sound: "opus", "g711-ulaw"; else ""
  readonly payload: Uint8Array;
}

export interface ReplayFeedback {
  readonly event: number;
  readonly issue: number;
  readonly arrived: number;
  readonly time: number; // s, the robot bridge's own clock
  readonly axes: readonly number[];
  readonly goals: readonly (number | null)[]; // applied; null of a rate axis, empty without goal axes
  readonly joints: readonly number[];
  readonly wrench: readonly number[];
  readonly ranges: readonly number[];
  readonly atRest: boolean;
  readonly stopped: boolean;
  readonly stopBy: string;
  readonly faults: readonly string[];
  readonly limits: readonly string[];
  readonly unknown: readonly string[];
}

/** A command that went to the robot. */
export interface ReplayCommand {
  readonly event: number;
  readonly issue: number;
  readonly arrived: number;
  readonly values: readonly (number | null)[]; // null: a goal axis stays where it is
  readonly name: string; // of who sent it
}

/** What the player needs of a chunk. */
export interface ReplayChunkContent {
  readonly number: number;
  readonly bytes: number;
  readonly media: ReadonlyMap<string, readonly ReplayRecord[]>; // pictures and sounds by topic, in order
  readonly feedback: readonly ReplayFeedback[];
  readonly commands: readonly ReplayCommand[];
  readonly seats: readonly { readonly arrived: number; readonly name: string }[];
  readonly losses: readonly number[]; // ids of the records that say that some before them were left out
  readonly broken: boolean; // it is damaged, and holds nothing that could be trusted
}

export const CAMERA = "/camera/";
export const MICROPHONE = "/microphone/";
const MOST_RECORDS = 1 << 16; // of a chunk
const MOST_NUMBERS = 4096; // of a list: more than a robot has axes, joints or rays
const MOST_TEXTS = 512;

export class ChunkBroken extends Error {}

/** The body of `chunks/{n}` (docs/recording.md, "HTTP"). Raises ChunkBroken. */
export function parseChunkBody(number: number, body: ArrayBuffer): ReplayChunkContent {
  const media = new Map<string, ReplayRecord[]>();
  const feedback: ReplayFeedback[] = [];
  const commands: ReplayCommand[] = [];
  const seats: { arrived: number; name: string }[] = [];
  const losses: number[] = [];
  for (const record of recordsOf(number, body)) {
    const { topic, payload, arrived } = record;
    if (topic.startsWith(CAMERA) || topic.startsWith(MICROPHONE)) {
      const list = media.get(topic);
      if (list === undefined) media.set(topic, [record]);
      else list.push(record);
    } else if (topic === "/lockstep/feedback") feedback.push(...parseFeedback(json(payload), arrived));
    else if (topic === "/lockstep/command") commands.push(...parseCommand(json(payload), arrived));
    else if (topic === "/lockstep/degraded") losses.push(record.id);
    else if (topic === "/lockstep/seat") {
      const seat = json(payload);
      if (isRecord(seat)) seats.push({ arrived, name: displayText(seat["name"]) });
    }
  }
  return { number, bytes: body.byteLength, media, feedback, commands, seats, losses, broken: false };
}

/** What stands for a chunk that is damaged. */
export function brokenChunk(number: number): ReplayChunkContent {
  return {
    number,
    bytes: 0,
    media: new Map(),
    feedback: [],
    commands: [],
    seats: [],
    losses: [],
    broken: true,
  };
}

/** In which chunk a record stands. */
export function chunkOfRecord(record: ReplayRecord): number {
  return Math.floor(record.id / MOST_RECORDS);
}

function* recordsOf(number: number, body: ArrayBuffer): Generator<ReplayRecord> {
  const view = new DataView(body);
  let at = 0;
  for (let count = 0; at < body.byteLength && count < MOST_RECORDS; count++) {
    const length = at + 4 <= body.byteLength ? view.getUint32(at) : Infinity;
    if (at + 4 + length > body.byteLength) throw new ChunkBroken("the chunk ends within a header");
    const head = json(new Uint8Array(body, at + 4, length));
    if (!isRecord(head)) throw new ChunkBroken("a header is not an object");
    at += 4 + length;
    const size = numeric(head["size"]);
    if (size < 0 || at + size > body.byteLength) throw new ChunkBroken("the chunk ends within a record");
    yield {
      id: number * MOST_RECORDS + count,
      topic: text(head["topic"]),
      event: numeric(head["event"]),
      arrived: numeric(head["arrived"]),
      captured: numeric(head["captured"]),
      keyframe: head["keyframe"] === true,
      format: text(head["format"]),
      payload: new Uint8Array(body, at, size),
    };
    at += size;
  }
}

const decoder = new TextDecoder();

function json(bytes: Uint8Array): unknown {
  try {
    return JSON.parse(decoder.decode(bytes)) as unknown;
  } catch (error) {
    throw new ChunkBroken("a header is not JSON", { cause: error });
  }
}

function parseFeedback(value: unknown, arrived: number): ReplayFeedback[] {
  if (!isRecord(value)) return [];
  const stop = isRecord(value["stop"]) ? value["stop"] : {};
  return [
    {
      event: numeric(value["event"]),
      issue: numeric(value["issue"]),
      arrived,
      time: numeric(value["time"]),
      axes: numbers(value["axes"]),
      goals: goals(value["goals"]),
      joints: numbers(value["joints"]),
      wrench: numbers(value["wrench"]),
      ranges: numbers(value["ranges"]),
      atRest: value["at_rest"] !== false,
      stopped: stop["stopped"] === true,
      stopBy: displayText(stop["by"]),
      faults: texts(value["faults"]),
      limits: texts(value["limits"]),
      unknown: texts(value["unknown"]),
    },
  ];
}

/** Only what was forwarded reached the robot. */
function parseCommand(value: unknown, arrived: number): ReplayCommand[] {
  if (!isRecord(value) || value["outcome"] !== "forwarded") return [];
  return [
    {
      event: numeric(value["event"]),
      issue: numeric(value["issue"]),
      arrived,
      values: goals(value["values"]),
      name: displayText(value["name"]),
    },
  ];
}

function numeric(value: unknown): number {
  return typeof value === "number" && Number.isFinite(value) ? value : 0;
}

function numbers(value: unknown): number[] {
  return Array.isArray(value) ? value.slice(0, MOST_NUMBERS).map(numeric) : [];
}

function goals(value: unknown): (number | null)[] {
  if (!Array.isArray(value)) return [];
  return value.slice(0, MOST_NUMBERS).map((each) => (each === null ? null : numeric(each)));
}

function text(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function texts(value: unknown): string[] {
  return Array.isArray(value) ? value.slice(0, MOST_TEXTS).map(displayText) : [];
}
