import { MICROPHONE, type ReplayRecord } from "./chunk";
import { chunkAt, type ReplayIndex } from "./index_table";
import type { ChunkCache } from "./chunk_cache";
import { decodeSound } from "./sound_decoder";

const AHEAD_US = 400_000; // how far ahead of the pictures sound is decoded
const PREROLL = 4; // packets that a decoder has to have heard (RFC 7845 4.6)
const LEAD_S = 0.05;

/** Plays the sound along with the pictures, at normal speed only; it follows them and never leads. */
export class SoundPlayer {
  private context: AudioContext | null = null;
  private until = -Infinity; // µs; what has arrived by then was handed on
  private zero: { time: number; at: number } | null = null; // recording time and audio clock that belong together
  private heard: readonly ReplayRecord[] = [];
  private turn = 0;
  private busy = false;

  constructor(
    private readonly store: ChunkCache,
    private readonly topics: readonly string[],
  ) {}

  /** From here on; call it for each picture. `time` in µs. */
  async follow(index: ReplayIndex, time: number): Promise<void> {
    const topic = this.topics[0];
    if (topic === undefined || this.busy) return;
    this.context ??= new AudioContext();
    if (this.context.state === "suspended") await this.context.resume();
    if (this.zero === null || this.drift(time) > 0.25) this.restart(time);
    if (time + AHEAD_US / 2 < this.until) return;
    this.busy = true;
    const turn = this.turn;
    try {
      const packets = await this.packets(index, topic, Math.max(time, this.until), time + AHEAD_US);
      if (turn === this.turn) await this.play(packets, turn);
    } finally {
      this.busy = false;
    }
  }

  stop(): void {
    this.turn++;
    this.zero = null;
    this.until = -Infinity;
    this.heard = [];
    const { context } = this;
    this.context = null;
    void context?.close();
  }

  /** Seconds that pictures and sound are apart. */
  private drift(time: number): number {
    if (this.context === null || this.zero === null) return Infinity;
    return Math.abs((time - this.zero.time) / 1e6 - (this.context.currentTime - this.zero.at));
  }

  private restart(time: number): void {
    this.turn++;
    this.until = time;
    this.heard = [];
    this.zero = { time, at: (this.context?.currentTime ?? 0) + LEAD_S };
  }

  private async packets(
    index: ReplayIndex,
    topic: string,
    after: number,
    until: number,
  ): Promise<ReplayRecord[]> {
    const last = Math.min(index.chunks.length - 1, chunkAt(index, until));
    const found: ReplayRecord[] = [];
    for (let number = chunkAt(index, after); number <= last; number++)
      found.push(...((await this.store.get(number)).media.get(topic) ?? []));
    this.until = until;
    return found.filter((each) => each.arrived > after && each.arrived <= until);
  }

  private async play(packets: readonly ReplayRecord[], turn: number): Promise<void> {
    const first = packets[0];
    if (first === undefined) return;
    const before = this.heard;
    this.heard = packets.slice(-PREROLL);
    const decoded = await decodeSound({ packets, before });
    const { context, zero } = this;
    if (decoded === null || context === null || zero === null || turn !== this.turn) return;
    const { samples, rate } = decoded;
    if (samples.length === 0) return;
    const buffer = context.createBuffer(1, samples.length, rate);
    buffer.copyToChannel(samples, 0);
    const source = new AudioBufferSourceNode(context, { buffer });
    source.connect(context.destination);
    source.start(Math.max(context.currentTime, zero.at + (first.captured - zero.time) / 1e6 + LEAD_S));
  }
}

/** The microphones of a recording. */
export function microphonesOf(index: ReplayIndex): string[] {
  return index.topics.filter((topic) => topic.startsWith(MICROPHONE));
}
