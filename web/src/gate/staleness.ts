import type { GateContext } from "./gate_counters";
import { eventGap } from "./serial";
import { eventsBehind } from "./gap_label";

/** Without any picture for this long the view counts as frozen. */
const FROZEN_MS = 1200;

/** Why the picture on screen must not be trusted, in words; null when it may. */
export function staleness(
  shown: number | null,
  lastDrawnMs: number | null,
  lastPictureMs: number | null,
  context: GateContext,
  now: number,
): string | null {
  if (lastDrawnMs === null) return "Waiting for the first picture";
  if (lastPictureMs === null || now - lastPictureMs > FROZEN_MS)
    return `No picture for ${Math.max(1, Math.round((now - (lastPictureMs ?? lastDrawnMs)) / 1000))} s`;
  const gap = gapOnScreen(shown, context);
  return context.gate === "event" && gap !== null && gap > context.tolerance ? eventsBehind(gap) : null;
}

/** By how many events the picture on screen is behind the newest feedback now; null while that is not known. */
export function gapOnScreen(
  shown: number | null,
  { feedback }: Pick<GateContext, "feedback">,
): number | null {
  return feedback === null || shown === null ? null : eventGap(feedback, shown);
}
