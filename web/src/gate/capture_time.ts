import { isEvent } from "./serial";

/**
 * The reference in a sender's capture clock offset (ms), as `getMetadata()` of an encoded frame shows it.
 * Null when it is absent or not a whole, valid reference.
 */
export function eventOfOffset(offsetMs: number | undefined): number | null {
  if (offsetMs === undefined || !Number.isFinite(offsetMs)) return null;
  const event = Math.round(offsetMs / 1000);
  return Math.abs(offsetMs - event * 1000) < 1 && isEvent(event) ? event : null;
}
