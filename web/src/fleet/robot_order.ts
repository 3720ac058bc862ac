import type { FleetRobot } from "./fleet_status";
import { isTrouble, TILE_KINDS, type TileKind } from "./tile_state";

export type FleetSorting = "trouble" | "name";

const COLLATOR = new Intl.Collator("en", { numeric: true });

/** A robot and what is known of its state. */
export interface Ranked {
  readonly robot: FleetRobot;
  readonly kind: TileKind;
}

/** By name, or those in trouble first. Whoever drives is no trouble: tiles do not move when the seat changes. */
export function sortFleet(tiles: readonly Ranked[], sorting: FleetSorting): string[] {
  const rank = ({ kind }: Ranked): number =>
    sorting === "trouble" && isTrouble(kind) ? TILE_KINDS.indexOf(kind) : TILE_KINDS.length;
  return tiles
    .toSorted((one, other) => rank(one) - rank(other) || COLLATOR.compare(one.robot.name, other.robot.name))
    .map(({ robot }) => robot.name);
}

/** Whether every word of `query` occurs in the robot's name or label. */
export function isFound(robot: FleetRobot, query: string): boolean {
  const text = `${robot.name} ${robot.label}`.toLowerCase();
  return query
    .toLowerCase()
    .split(/\s+/)
    .filter(Boolean)
    .every((word) => text.includes(word));
}

/** "8 robots: 1 unreachable, 2 stopped, 3 driven" */
export function summaryLabel(kinds: readonly TileKind[]): string {
  const names: Readonly<Record<TileKind, string>> = {
    trouble: "in trouble",
    unreachable: "unreachable",
    unknown: "unknown",
    stopped: "stopped",
    silent: "silent",
    behind: "behind",
    driven: "driven",
    free: "free",
  };
  const parts = TILE_KINDS.map((kind) => [kinds.filter((each) => each === kind).length, names[kind]] as const)
    .filter(([count]) => count > 0)
    .map(([count, name]) => `${count} ${name}`);
  return `${robotsLabel(kinds.length)}${parts.length === 0 ? "" : `: ${parts.join(", ")}`}`;
}

export function robotsLabel(count: number): string {
  return count === 1 ? "1 robot" : `${count} robots`;
}
