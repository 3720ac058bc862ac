import {
  CAMERA,
  chunkOfRecord,
  MICROPHONE,
  type ReplayChunkContent,
  type ReplayCommand,
  type ReplayFeedback,
  type ReplayRecord,
} from "./chunk";
import { isNewer } from "../gate/serial";

/** A place in a recording: an event, as it stood when its last record had come, or at a time within it (µs). */
export interface ReplayPlace {
  readonly event: number;
  readonly until: number | null;
}

/** A picture, and what its decoder has to see before it: from a keyframe on, the picture itself last. */
export interface ReplayPicture {
  readonly record: ReplayRecord;
  readonly sequence: readonly ReplayRecord[];
  readonly feedback?: ReplayFeedback; // of exactly its event, the newest when it came; none if that is not loaded
}

/** A segment of sound, and the packets before it, which a decoder has to have heard. */
export interface ReplaySegment {
  readonly packets: readonly ReplayRecord[];
  readonly before: readonly ReplayRecord[];
}

/** The segment in parts that one decoder takes each: the codec of sound can change from packet to packet. */
export function soundRuns({ packets, before }: ReplaySegment): ReplaySegment[] {
  const runs: { packets: ReplayRecord[]; before: readonly ReplayRecord[] }[] = [];
  for (const each of packets) {
    const run = runs.at(-1);
    if (run?.packets[0]?.format === each.format) {
      run.packets.push(each);
    } else {
      const other = before.findLastIndex((one) => one.format !== each.format);
      runs.push({ packets: [each], before: run === undefined ? before.slice(other + 1) : [] });
    }
  }
  return runs;
}

/** Everything that belongs to one event. */
export interface ReplayMoment {
  readonly place: ReplayPlace;
  readonly feedback: ReplayFeedback | null; // its newest issue
  readonly command: ReplayCommand | null; // that became the event; null for the first one
  readonly driver: string | null; // who held the seat; null: not known from what is loaded
  readonly pictures: ReadonlyMap<string, ReplayPicture>; // by topic; none where none can be decoded
  readonly sounds: ReadonlyMap<string, ReplaySegment>; // by topic; the packets of its newest stamp
  readonly damaged: boolean; // a part that belongs to it cannot be read: what is missing may have been there
}

const MOST_PACKETS = 100; // of sound: two seconds
const PREROLL = 4; // packets: 80 ms (RFC 7845 4.6)

/** `chunks`: those that are loaded, in order. */
export function momentOf(chunks: readonly ReplayChunkContent[], place: ReplayPlace): ReplayMoment {
  const until = place.until ?? Infinity;
  const feedback = chunks.flatMap((chunk) =>
    chunk.feedback.filter((each) => each.event === place.event && each.arrived <= until),
  );
  const commands = chunks.flatMap((chunk) => chunk.commands.filter((each) => each.event === place.event));
  const latest = feedback.at(-1)?.arrived ?? until;
  const seats = chunks.flatMap((chunk) => chunk.seats.filter((each) => each.arrived <= latest));
  const pictures = new Map<string, ReplayPicture>();
  const sounds = new Map<string, ReplaySegment>();
  const lastBroken = chunks.findLast((chunk) => chunk.broken)?.number ?? -1;
  const isWhole = (first: ReplayRecord | undefined): boolean =>
    first !== undefined && chunkOfRecord(first) > lastBroken;
  const losses = chunks.flatMap((chunk) => chunk.losses);
  /** A picture may build on one that was left out. */
  const isTorn = ([first]: readonly ReplayRecord[], record: ReplayRecord): boolean =>
    first !== undefined && losses.some((id) => first.id < id && id < record.id);
  for (const topic of topicsOf(chunks)) {
    const records = chunks.flatMap((chunk) => chunk.media.get(topic) ?? []);
    if (topic.startsWith(CAMERA)) {
      const picture = pictureAt(records, place.event, until);
      if (picture === null || isTorn(picture.sequence, picture.record)) continue;
      if (isWhole(picture.sequence[0])) pictures.set(topic, withFeedback(picture, chunks));
    } else if (topic.startsWith(MICROPHONE)) {
      const segment = segmentAt(records, place.event, until);
      if (isWhole(segment.packets[0])) sounds.set(topic, segment);
    }
  }
  return {
    place,
    feedback: feedback.at(-1) ?? null,
    // A further one is forwarded only after the bridge refused the one before: the last one became the event.
    command: commands.at(-1) ?? null,
    driver: seats.at(-1)?.name ?? null,
    pictures,
    sounds,
    damaged: lastBroken !== -1,
  };
}

/** The event that held at `time`; null: no feedback of that time is loaded. */
export function eventAtTime(chunks: readonly ReplayChunkContent[], time: number): number | null {
  for (const chunk of chunks.toReversed()) {
    const found = chunk.feedback.findLast((each) => each.arrived <= time);
    if (found !== undefined) return found.event;
  }
  return null;
}

/** The newest picture stamped `event` or earlier. */
export function pictureAt(
  records: readonly ReplayRecord[],
  event: number,
  until: number,
): ReplayPicture | null {
  const last = records.findLastIndex((record) => !isNewer(record.event, event) && record.arrived <= until);
  if (last === -1) return null;
  const first = records.findLastIndex((record, at) => at <= last && record.keyframe);
  const record = records[last];
  if (first === -1 || record === undefined) return null;
  return { record, sequence: records.slice(first, last + 1) };
}

function withFeedback(picture: ReplayPicture, chunks: readonly ReplayChunkContent[]): ReplayPicture {
  const { event, arrived } = picture.record;
  const issues = chunks.flatMap((chunk) => chunk.feedback.filter((each) => each.event === event));
  const feedback = issues.findLast((each) => each.arrived <= arrived) ?? issues[0];
  return feedback === undefined ? picture : { ...picture, feedback };
}

/** The packets that carry the newest stamp that is not newer than `event`. */
export function segmentAt(records: readonly ReplayRecord[], event: number, until: number): ReplaySegment {
  const stamp = records.findLast((record) => !isNewer(record.event, event) && record.arrived <= until)?.event;
  const packets = records
    .filter((record) => record.event === stamp && record.arrived <= until)
    .slice(-MOST_PACKETS);
  const first = packets[0];
  const at = first === undefined ? 0 : records.indexOf(first);
  return { packets, before: records.slice(Math.max(0, at - PREROLL), at) };
}

function topicsOf(chunks: readonly ReplayChunkContent[]): Set<string> {
  return new Set(chunks.flatMap((chunk) => [...chunk.media.keys()]));
}
