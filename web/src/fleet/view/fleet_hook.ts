import type { PollPhase } from "../poll_state";
import type { StopAllLabels } from "../stop_all";
import { stopAllLabels } from "../stop_all";
import type { TileKind } from "../tile_state";
import type { FleetPage } from "./fleet_page";
import type { Tile } from "./tile";

/** What one tile shows. */
export interface TileStatistics {
  readonly name: string;
  readonly state: TileKind | null;
  readonly words: string;
  readonly picture: "live" | "none" | "stale";
  readonly veil: string | null; // why the picture is not live
  readonly connected: boolean; // whether it has a connection for its picture
  readonly stamp: number | null; // of the picture that was drawn last
  readonly gap: number | null; // of that picture
  readonly rendered: number;
  readonly violations: number; // pictures drawn out of tolerance: 0
}

/** `window.lockstepFleet`: live figures for tests and operators' own tools (docs/fleet.md). */
export interface FleetHook {
  stats(): {
    readonly phase: PollPhase;
    readonly open: number; // live pictures now
    readonly stop: StopAllLabels | null;
    readonly robots: readonly TileStatistics[]; // in the order of the page
  };
}

declare global {
  interface Window {
    lockstepFleet?: FleetHook;
  }
}

export function installFleetHook(page: FleetPage): void {
  window.lockstepFleet = {
    stats: () => ({
      phase: page.phase(performance.now()),
      open: page.thumbnails.open.size,
      stop: stopAllLabels(page.stopping.stop),
      robots: page.shown.map(statisticsOf),
    }),
  };
}

function statisticsOf(tile: Tile): TileStatistics {
  const { name, state, thumbnail, element } = tile;
  const gate = thumbnail?.video?.gate;
  const { picture } = element.dataset;
  return {
    name,
    state: state?.kind ?? null,
    words: state?.words ?? "",
    picture: picture === "live" || picture === "stale" ? picture : "none",
    veil: tile.pictureSays,
    connected: thumbnail !== null,
    stamp: gate?.shown ?? null,
    gap: gate?.counts.gap ?? null,
    rendered: gate?.counts.rendered ?? 0,
    violations: gate?.counts.violations ?? 0,
  };
}
