import { momentOf, eventAtTime, type ReplayMoment, type ReplayPlace } from "./moment";
import { CAMERA, type ReplayChunkContent } from "./chunk";
import { chunkAt, chunksOf, keyframeBefore, type ReplayIndex } from "./index_table";
import { isNewer } from "../gate/serial";
import type { ChunkCache } from "./chunk_cache";

const GROUP_US = 20_000_000; // longer than from any keyframe to the next
const COMMAND_CHUNKS = 16; // before an event's feedback, in which its command is looked for
const AHEAD = 3; // chunks

/** Finds what belongs to an event: asks for as few chunks as that needs. */
export class MomentLoader {
  constructor(private readonly store: ChunkCache) {}

  async load(index: ReplayIndex, place: ReplayPlace): Promise<ReplayMoment> {
    const range = chunksOf(index, place.event);
    if (range === null) return momentOf([], place);
    const last =
      place.until === null
        ? range.last
        : Math.max(range.first, Math.min(range.last, chunkAt(index, place.until)));
    const wanted = new Set([last, ...this.commandChunks(index, place.event, range)]);
    for (const number of pictureChunks(index, place, last)) wanted.add(number);
    const loading = this.store.all(wanted);
    this.store.prefetch(upTo(last + 1, Math.min(last + AHEAD, index.chunks.length - 1)));
    const feedback = await this.feedbackChunk(place, range.first, last);
    const chunks = await loading;
    if (!wanted.has(feedback.number)) chunks.push(feedback);
    return momentOf(
      chunks.toSorted((one, other) => one.number - other.number),
      place,
    );
  }

  /** The event that held at `time`, µs; null: none did yet. */
  async eventAt(index: ReplayIndex, time: number): Promise<number | null> {
    for (let number = chunkAt(index, time); number >= 0 && index.chunks.length > 0; number--) {
      const found = eventAtTime([await this.store.get(number)], time);
      if (found !== null) return found;
    }
    return null;
  }

  /** Commands come before the first feedback of their event. */
  private commandChunks(
    index: ReplayIndex,
    event: number,
    range: { readonly first: number; readonly last: number },
  ): number[] {
    const next = index.events.find((entry) => !isNewer(event, entry[0]));
    const last = Math.max(range.first, Math.min(range.last, next?.[2] ?? range.last));
    return upTo(Math.max(range.first, last - COMMAND_CHUNKS), last);
  }

  private async feedbackChunk(place: ReplayPlace, first: number, last: number): Promise<ReplayChunkContent> {
    const until = place.until ?? Infinity;
    for (let number = last; ; number--) {
      const chunk = await this.store.get(number);
      const has = chunk.feedback.some((each) => each.event === place.event && each.arrived <= until);
      if (has || number <= first) return chunk;
    }
  }
}

/** From the keyframe before the place on, for each camera. */
function pictureChunks(index: ReplayIndex, place: ReplayPlace, last: number): number[] {
  const until = place.until ?? Infinity;
  return index.topics
    .filter((topic) => topic.startsWith(CAMERA))
    .flatMap((topic) => {
      const keyframe = keyframeBefore(index, topic, place.event, until);
      if (keyframe === null) return [];
      return upTo(keyframe[2], Math.min(last, chunkAt(index, keyframe[1] + GROUP_US)));
    });
}

function upTo(first: number, last: number): number[] {
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, at) => first + at);
}
