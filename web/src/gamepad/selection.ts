/** Of the pads that are plugged in, which one drives. */
export interface PadCandidate {
  readonly index: number; // Gamepad.index
  readonly id: string; // Gamepad.id
  readonly ready: boolean; // its layout is known
}

/**
 * The index of the pad to read; null when there is none. The one in use stays in use while it is plugged in, whatever
 * else is: another pad takes over only by its user's choice, or after the first one is gone. A pad that cannot drive
 * makes room for one that can.
 */
export function choosePad(
  candidates: readonly PadCandidate[],
  current: { readonly index: number; readonly id: string } | null,
  preferred: string | null,
): number | null {
  const stays = candidates.find((pad) => pad.index === current?.index && pad.id === current.id);
  if (stays?.ready === true) return stays.index;
  const best =
    candidates.find((pad) => pad.id === preferred && pad.ready) ??
    candidates.find((pad) => pad.ready) ??
    stays ??
    candidates.find((pad) => pad.id === preferred) ??
    candidates[0];
  return best?.index ?? null;
}
