import { brokenChunk, ChunkBroken, type ReplayChunkContent } from "./chunk";
import { ConsoleError } from "../transport/signalling/console_api";

const MOST_BYTES = 96 * 1024 * 1024;
const AT_ONCE = 6;

/**
 * Chunks as they were asked for; the one that was used longest ago goes first. A damaged one is asked for once, and is
 * empty from then on.
 */
export class ChunkCache {
  readonly damaged = new Set<number>();
  failed = 0; // requests that brought nothing, and may bring it another time
  private readonly kept = new Map<number, ReplayChunkContent>();
  private readonly coming = new Map<number, Promise<ReplayChunkContent>>();
  private readonly closing = new AbortController();
  private bytes = 0;

  constructor(private readonly load: (number: number, signal: AbortSignal) => Promise<ReplayChunkContent>) {}

  /** Raises what the request raises. */
  async get(number: number): Promise<ReplayChunkContent> {
    const kept = this.kept.get(number);
    if (kept !== undefined) {
      this.kept.delete(number);
      this.kept.set(number, kept);
      return kept;
    }
    const coming = this.coming.get(number);
    if (coming !== undefined) return coming;
    const asked = this.fetch(number);
    this.coming.set(number, asked);
    return asked;
  }

  /** In the order of their numbers. */
  all(numbers: Iterable<number>): Promise<ReplayChunkContent[]> {
    const sorted = [...new Set(numbers)].sort((one, other) => one - other);
    return Promise.all(sorted.map((number) => this.get(number)));
  }

  /** Asks for them without waiting. */
  prefetch(numbers: Iterable<number>): void {
    for (const number of numbers) if (this.coming.size < AT_ONCE) this.get(number).catch(() => undefined); // asked for again when it is needed
  }

  close(): void {
    this.closing.abort();
    this.kept.clear();
  }

  private async fetch(number: number): Promise<ReplayChunkContent> {
    try {
      const content = await this.loaded(number);
      this.kept.set(number, content);
      this.bytes += content.bytes;
      for (const [oldest, { bytes }] of this.kept) {
        if (this.bytes <= MOST_BYTES || oldest === number) break;
        this.kept.delete(oldest);
        this.bytes -= bytes;
      }
      return content;
    } finally {
      this.coming.delete(number);
    }
  }

  private async loaded(number: number): Promise<ReplayChunkContent> {
    try {
      return await this.load(number, this.closing.signal);
    } catch (error) {
      if (!isDamage(error)) {
        this.failed++;
        throw error;
      }
      this.damaged.add(number);
      return brokenChunk(number);
    }
  }
}

function isDamage(error: unknown): boolean {
  return (
    error instanceof ChunkBroken || (error instanceof ConsoleError && error.error === "recording_damaged")
  );
}
