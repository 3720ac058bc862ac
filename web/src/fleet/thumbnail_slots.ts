/** Live pictures of the overview at once. */
export const THUMBNAIL_LIMIT = 8;
/** A tile that is only scrolled past gets no picture. */
export const SETTLE_MS = 250;
/** Connections that are being made at once: each costs the console a keyframe. */
export const OPENING_LIMIT = 2;

/** A tile that could show a live picture, in the order of the page. */
export interface SlotCandidate {
  readonly name: string;
  readonly inViewMs: number | null; // since when; null: out of view
  readonly possible: boolean; // the robot can be reached here and has a camera
  readonly isOpen: boolean;
  readonly isOpening: boolean; // open, but not connected yet
  readonly attention: boolean; // somebody points at it, or has the keyboard there
}

/** Who has a live picture from now on. Open ones stay while they are in view: pictures do not come and go in turns. */
export function giveSlots(candidates: readonly SlotCandidate[], visible: boolean, now: number): Set<string> {
  if (!visible) return new Set();
  const rank = (tile: SlotCandidate): number => (tile.attention ? 0 : tile.isOpen ? 1 : 2);
  const wanted = candidates
    .filter((tile) => tile.possible && tile.inViewMs !== null)
    .filter((tile) => tile.isOpen || now - (tile.inViewMs ?? now) >= SETTLE_MS)
    .toSorted((one, other) => rank(one) - rank(other))
    .slice(0, THUMBNAIL_LIMIT);
  let opening = wanted.filter((tile) => tile.isOpening).length;
  const given = wanted.filter((tile) => tile.isOpen || opening++ < OPENING_LIMIT);
  return new Set(given.map((tile) => tile.name));
}
