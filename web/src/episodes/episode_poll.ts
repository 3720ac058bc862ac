import type { EpisodeList, RecordingEpisodes } from "./episode_list";
import type { EpisodesApi } from "./episodes_api";

const REFRESH_MS = 4000;
const PENDING_MS = 300; // while the console is still reading files
const TROUBLE_MS = 3000;

export interface PollState {
  readonly recordings: readonly RecordingEpisodes[] | null; // null: nothing is known yet
  readonly older: number;
  readonly pending: number;
  readonly unreadable: number;
  readonly trouble: unknown; // error of the last request; null without one
  readonly asOf: number; // ms, of the newest answer; performance.now()
}

/** Asks for the list over and over, while the page is seen. `close` it. */
export class EpisodePoll {
  state: PollState = { recordings: null, older: 0, pending: 0, unreadable: 0, trouble: null, asOf: 0 };
  private version = "";
  private pages: RecordingEpisodes[] = []; // those behind the first answer, as far as somebody asked for them
  private pagesOlder = -1; // behind these; -1: nobody asked
  private readonly changed = new Map<string, RecordingEpisodes>(); // by this page, newer than the list
  private timer: ReturnType<typeof setTimeout> | undefined;
  private asking = false;
  private closed = false;

  constructor(
    private readonly api: Pick<EpisodesApi, "list">,
    private readonly tell: () => void,
    private readonly isSeen: () => boolean,
  ) {}

  start(): void {
    void this.refresh();
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
  }

  /** At once, as when the page is seen again. */
  hurry(): void {
    if (this.asking || this.closed) return;
    clearTimeout(this.timer);
    void this.refresh();
  }

  /** What the answer to a change said of one recording. */
  put(recording: RecordingEpisodes): void {
    this.changed.set(recording.id, recording);
    const { recordings } = this.state;
    if (recordings !== null) this.state = { ...this.state, recordings: this.withChanges(recordings) };
    this.tell();
  }

  async askOlder(): Promise<void> {
    const skip = (this.state.recordings ?? []).filter((each) => !each.running).length;
    try {
      const found = await this.api.list("", skip);
      const known = new Set((this.state.recordings ?? []).map((each) => each.id));
      const further = found.recordings.filter((each) => !known.has(each.id));
      this.pages = [...this.pages, ...further];
      this.pagesOlder = found.older;
      const recordings = [...(this.state.recordings ?? []), ...further];
      this.state = { ...this.state, recordings, older: found.older, trouble: null };
    } catch (error) {
      this.state = { ...this.state, trouble: error };
    }
    this.tell();
  }

  private async refresh(): Promise<void> {
    let wait = REFRESH_MS;
    this.asking = true;
    if (this.isSeen()) {
      try {
        const found = await this.api.list(this.version, 0);
        this.take(found);
        if (found.pending > 0) wait = PENDING_MS;
      } catch (error) {
        this.state = { ...this.state, trouble: error };
        wait = TROUBLE_MS;
      }
      if (!this.closed) this.tell();
    }
    this.asking = false;
    if (this.closed) return;
    this.timer = setTimeout(() => void this.refresh(), wait);
  }

  private take(found: EpisodeList): void {
    this.version = found.version;
    const asOf = performance.now();
    if (found.unchanged) {
      this.state = { ...this.state, trouble: null, asOf };
      return;
    }
    const known = new Set(found.recordings.map((each) => each.id));
    const beyond = this.pages.filter((each) => !known.has(each.id));
    this.state = {
      recordings: this.withChanges([...found.recordings, ...beyond]),
      older: this.pagesOlder === -1 ? found.older : this.pagesOlder,
      pending: found.pending,
      unreadable: found.unreadable,
      trouble: null,
      asOf,
    };
  }

  private withChanges(recordings: readonly RecordingEpisodes[]): RecordingEpisodes[] {
    return recordings.map((each) => {
      const newer = this.changed.get(each.id);
      if (newer === undefined || newer.revision < each.revision) {
        this.changed.delete(each.id);
        return each;
      }
      // Of a recording that is being written, the list knows more than the answer to a change did.
      return newer.revision === each.revision ? each : newer;
    });
  }
}
