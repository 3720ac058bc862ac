import { parseIndex, type ReplayIndex } from "./index_table";
import { parseChunkBody, type ReplayChunkContent } from "./chunk";
import { parseEntry, parseList, type RecordingEntry, type RecordingList } from "./recording_list";
import { isRecord } from "../protocol/schema_check";
import { ConsoleError, type ConsoleApi } from "../transport/signalling/console_api";
import type { RobotDescription } from "../protocol/wire";
import { parseDescription } from "../protocol/wire_parser";

const LIMIT_MS = 20_000;
const REPORT_MS = 150_000; // a long recording is read as a whole

export interface RecordingDetails {
  readonly entry: RecordingEntry;
  readonly description: RobotDescription | null; // null before its first chunk is written
  readonly index: ReplayIndex;
}

/** Recordings over HTTP (docs/recording.md). All of it raises ConsoleError. */
export class RecordingsApi {
  constructor(private readonly api: ConsoleApi) {}

  /** The newest; with `before` the newest of those that began before that time, in µs since 1970. */
  async list(before = 0): Promise<RecordingList> {
    const path = `/api/recordings${before > 0 ? `?before=${before}` : ""}`;
    return parseList(await this.api.json("GET", path, undefined, limit()));
  }

  /** `after`: only what the index has from that chunk on. */
  async details(id: string, after: number): Promise<RecordingDetails> {
    const path = `/api/recordings/${encodeURIComponent(id)}${after > 0 ? `?after=${after}` : ""}`;
    const found = await this.api.json("GET", path, undefined, limit());
    const index = isRecord(found) ? parseIndex(found["index"]) : null;
    const entry = isRecord(found) ? parseEntry(found["info"]) : null;
    if (index === null || entry === null || !isRecord(found))
      throw new ConsoleError(200, "malformed", "the index cannot be read", null);
    return { entry, index, description: parseDescription(found["description"]) };
  }

  /** Raises also ChunkBroken. */
  async chunk(id: string, number: number, signal: AbortSignal): Promise<ReplayChunkContent> {
    const path = `/api/recordings/${encodeURIComponent(id)}/chunks/${number}`;
    return parseChunkBody(number, await this.api.bytes(path, AbortSignal.any([signal, limit()])));
  }

  /** Where the browser can download it by itself, for a few minutes. */
  async download(id: string): Promise<string> {
    const path = `/api/recordings/${encodeURIComponent(id)}/ticket`;
    const found = await this.api.json("POST", path, undefined, limit());
    const link = isRecord(found) ? found["path"] : undefined;
    if (typeof link !== "string" || !link.startsWith(new URL("./api/recordings/", document.baseURI).pathname))
      throw new ConsoleError(200, "malformed", "no path", null);
    return link;
  }

  /** An HTML page. */
  async report(id: string): Promise<ArrayBuffer> {
    const path = `/api/recordings/${encodeURIComponent(id)}/report`;
    return await this.api.bytes(path, AbortSignal.timeout(REPORT_MS));
  }

  async delete(id: string): Promise<RecordingList> {
    const path = `/api/recordings/${encodeURIComponent(id)}`;
    return parseList(await this.api.json("DELETE", path, undefined, limit()));
  }
}

function limit(): AbortSignal {
  return AbortSignal.timeout(LIMIT_MS);
}
