import {
  parseEpisodeList,
  parseRecording,
  type EpisodeList,
  type Outcome,
  type RecordingEpisodes,
} from "./episode_list";
import { ConsoleError, type ConsoleApi } from "../transport/signalling/console_api";

const LIMIT_MS = 30_000;
const REPORT_MS = 150_000;

/** One kind of change (docs/episodes.md). */
export type Change =
  | { readonly episode: string; readonly task?: string; readonly outcome?: Outcome }
  | { readonly episode: string; readonly first_event: number; readonly last_event: number }
  | { readonly episode: string; readonly dropped: boolean }
  | { readonly episode: string; readonly split: number }
  | { readonly episode: string; readonly merge: string }
  | { readonly undo: number };

/** Episodes over HTTP. All of it raises ConsoleError. */
export class EpisodesApi {
  constructor(private readonly api: ConsoleApi) {}

  /** `known`: the version that the page has; the answer is short then while nothing has changed. */
  async list(known: string, skip: number): Promise<EpisodeList> {
    const query = new URLSearchParams({ known, skip: String(skip) });
    const found = parseEpisodeList(
      await this.api.json("GET", `/api/episodes?${query}`, undefined, limit(LIMIT_MS)),
    );
    if (found === null) throw malformed();
    return found;
  }

  async recording(id: string): Promise<RecordingEpisodes> {
    return parsed(await this.api.json("GET", pathOf(id, "episodes"), undefined, limit(LIMIT_MS)));
  }

  /** `revision`: of the recording that the change was made of; a newer one makes the console refuse it. */
  async change(id: string, revision: number, change: Change): Promise<RecordingEpisodes> {
    const body = { revision, ...change };
    return parsed(await this.api.json("POST", pathOf(id, "episodes"), body, limit(LIMIT_MS)));
  }

  /** A JPEG. */
  async picture(id: string, camera: string, event: number, width: number): Promise<ArrayBuffer> {
    const query = new URLSearchParams({ camera, event: String(event), width: String(width) });
    return await this.api.bytes(`${pathOf(id, "picture")}?${query}`, limit(LIMIT_MS));
  }

  /** An HTML page. */
  async report(id: string): Promise<ArrayBuffer> {
    return await this.api.bytes(pathOf(id, "report"), limit(REPORT_MS));
  }
}

function parsed(value: unknown): RecordingEpisodes {
  const found = parseRecording(value);
  if (found === null) throw malformed();
  return found;
}

function malformed(): ConsoleError {
  return new ConsoleError(200, "malformed", "the answer is no list of episodes", null);
}

function pathOf(id: string, what: string): string {
  return `/api/recordings/${encodeURIComponent(id)}/${what}`;
}

function limit(ms: number): AbortSignal {
  return AbortSignal.timeout(ms);
}
