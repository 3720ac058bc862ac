import { ConsoleError } from "../transport/signalling/console_api";

const AT_ONCE = 3; // requests
const MOST_KEPT = 400; // pictures
const AGAIN_MS = 1500; // after the console said that it has too much to do
const TRIES = 4;

export interface PictureWanted {
  readonly recording: string;
  readonly camera: string;
  readonly event: number;
  readonly width: number;
}

type Fetch = (wanted: PictureWanted) => Promise<ArrayBuffer>;

interface Waiting {
  readonly wanted: PictureWanted;
  readonly resolve: (url: string | null) => void;
  tries: number;
}

/** Fetches pictures, a few at a time, those asked for last first; keeps some as object URLs. `close` it. */
export class PictureLoader {
  private readonly kept = new Map<string, string>(); // URL by what it shows, the oldest first
  private readonly waiting: Waiting[] = [];
  private running = 0;
  private closed = false;

  constructor(private readonly fetch: Fetch) {}

  /** The URL of a picture that is there already. */
  known(wanted: PictureWanted): string | null {
    return this.kept.get(keyOf(wanted)) ?? null;
  }

  /** Its URL; null: there is none, or nobody waits for it any more. */
  load(wanted: PictureWanted, signal: AbortSignal): Promise<string | null> {
    const known = this.known(wanted);
    if (known !== null) return Promise.resolve(known);
    return new Promise((resolve) => {
      const entry: Waiting = { wanted, resolve, tries: 0 };
      this.waiting.push(entry);
      signal.addEventListener("abort", () => this.forget(entry));
      this.next();
    });
  }

  close(): void {
    this.closed = true;
    for (const entry of this.waiting.splice(0)) entry.resolve(null);
    for (const url of this.kept.values()) URL.revokeObjectURL(url);
    this.kept.clear();
  }

  private forget(entry: Waiting): void {
    const at = this.waiting.indexOf(entry);
    if (at !== -1) this.waiting.splice(at, 1);
    entry.resolve(null);
  }

  private next(): void {
    while (this.running < AT_ONCE) {
      const entry = this.waiting.pop();
      if (entry === undefined) return;
      this.running += 1;
      void this.run(entry);
    }
  }

  private async run(entry: Waiting): Promise<void> {
    entry.tries += 1;
    try {
      const bytes = await this.fetch(entry.wanted);
      if (!this.closed) entry.resolve(this.keep(entry.wanted, bytes));
    } catch (error) {
      const busy = error instanceof ConsoleError && error.status === 429;
      if (busy && entry.tries < TRIES && !this.closed) {
        await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
        this.waiting.unshift(entry);
      } else entry.resolve(null);
    } finally {
      this.running -= 1;
      if (!this.closed) this.next();
    }
  }

  private keep(wanted: PictureWanted, bytes: ArrayBuffer): string {
    const key = keyOf(wanted);
    const url = this.kept.get(key) ?? URL.createObjectURL(new Blob([bytes], { type: "image/jpeg" }));
    this.kept.set(key, url);
    for (const [oldest, each] of this.kept) {
      if (this.kept.size <= MOST_KEPT) break;
      this.kept.delete(oldest);
      URL.revokeObjectURL(each);
    }
    return url;
  }
}

function keyOf({ recording, camera, event, width }: PictureWanted): string {
  return `${recording}\n${camera}\n${event}\n${width}`;
}
