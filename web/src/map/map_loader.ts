import type { ConsoleApi } from "../transport/signalling/console_api";
import { readMap, type GridMap } from "./map_cells";

const AGAIN_MS = 2000; // between two requests
const LIMIT_MS = 15_000;

/** Keeps the map that the robot names. Another one is never given in its place. */
export class MapLoader {
  private loaded: GridMap | null = null;
  private loading = false;
  private askedMs = -Infinity;

  constructor(private readonly api: Pick<ConsoleApi, "json">) {}

  /** The map of this id; null while it is not there. */
  map(id: string, now: number): GridMap | null {
    if (id === "") return null;
    if (this.loaded?.id === id) return this.loaded;
    if (!this.loading && now - this.askedMs >= AGAIN_MS) void this.load(now);
    return null;
  }

  private async load(now: number): Promise<void> {
    this.loading = true;
    this.askedMs = now;
    try {
      this.loaded = await readMap(
        await this.api.json("GET", "/api/map", undefined, AbortSignal.timeout(LIMIT_MS)),
      );
    } catch {
      this.loaded = null; // it is asked for again
    } finally {
      this.loading = false;
    }
  }
}
