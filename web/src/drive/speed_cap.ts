import type { SpeedCapState } from "../protocol/wire";
import type { Latency } from "./latency";

/** Up to this delay between command and picture nothing is slowed (German StVFernLV). */
const FREE_MS = 200;
/** What a delay that is not known counts as: doubt is slow. The console does the same. */
const UNKNOWN_MS = 1000;
/** A picture this long ago says nothing about now. */
const FORGOTTEN_MS = 3000;
const RECENT = 15; // pictures

/**
 * How late the operator sees now; null when nothing tells. While a command waits for its picture for longer than
 * others did lately, the wait counts: a picture that stands still must not keep its last good delay.
 */
export function viewDelay(latency: Latency, now: number): number | null {
  if (now - latency.pictureAtMs > FORGOTTEN_MS) return null;
  const recent = latency.toPicture.values.slice(-RECENT).toSorted((left, right) => left - right);
  const usual = recent[Math.floor(recent.length / 2)];
  if (usual === undefined) return null;
  const [waitingSince] = latency.awaitingPicture.values();
  return waitingSince === undefined ? usual : Math.max(usual, now - waitingSince);
}

/** v <= v_max * min(1, 0.2 s / delay). */
export function speedShare(delayMs: number | null): number {
  return Math.min(1, FREE_MS / Math.max(delayMs ?? UNKNOWN_MS, 1));
}

/** Whether the speed is capped: as the console says, or as the operator wants where it leaves that open. */
export function capHolds(console: SpeedCapState | null, wanted: boolean): boolean {
  return console === null || console.mode === "operator" ? wanted : console.mode === "on";
}

/** Whether the operator has the choice. */
export function capIsChoice(console: SpeedCapState | null): boolean {
  return console === null || console.mode === "operator";
}

/** Share of full speed to ask for: the console clamps to its own, so the smaller of the two is what is driven. */
export function cappedShare(console: SpeedCapState | null, wanted: boolean, delayMs: number | null): number {
  if (!capHolds(console, wanted)) return 1;
  return Math.min(speedShare(delayMs), console?.holds === true ? console.share : 1);
}
