import type { TileKind } from "./tile_state";

/** "1 of 4", "1" where no tolerance is known, a dash without a gap. */
export function gapLabel(gap: number | null, tolerance: number | null): string {
  if (gap === null) return "–";
  return tolerance === null ? `${gap}` : `${gap} of ${tolerance}`;
}

/**
 * What stands over a tile's picture; null when it is live. `instead`: why it has no connection of its own; `veil`: what
 * its connection says against the picture, while there is one.
 */
export function pictureLabel(
  kind: TileKind | null,
  instead: string | null,
  veil: string | null,
): string | null {
  if (kind === null || kind === "unknown") return "Unknown";
  if (kind === "unreachable") return "No picture";
  return instead ?? veil;
}
