import { STANDARD_LAYOUT, type PadLayout } from "./layout";
import { lacks, type PadSnapshot } from "./mapping";
import { DEFAULT_SHAPING, type PadShaping } from "./stick_shape";
import { isStandard } from "./standard_mapping";

/** What is kept of one kind of pad. */
export interface PadProfile {
  readonly id: string; // Gamepad.id: all pads of one make share it
  readonly layout: PadLayout | null; // null: the browser's standard mapping
  readonly shaping: PadShaping;
}

/** How one pad is read now. */
export interface PadSetup {
  readonly layout: PadLayout | null; // null: it has to be calibrated before it can drive
  readonly shaping: PadShaping;
  readonly calibrated: boolean; // by its user; else the browser knows its mapping, or nobody does
}

/** The setup of a pad by the profiles. A layout that does not fit the pad is no layout. */
export function setupOf(pad: PadSnapshot, profiles: readonly PadProfile[]): PadSetup {
  const profile = profiles.find((each) => each.id === pad.id);
  const own = profile?.layout ?? null;
  const fits = own !== null && !lacks(pad, own);
  const known = isStandard(pad) ? STANDARD_LAYOUT : null;
  return {
    layout: fits ? own : known,
    shaping: profile?.shaping ?? DEFAULT_SHAPING,
    calibrated: fits,
  };
}

/** "DualShock 4" of "DualShock 4 (STANDARD GAMEPAD Vendor: 054c Product: 05c4)" */
export function padName(id: string): string {
  return id.replace(/\s*\(.*$/, "").trim() || "Gamepad";
}

/** The profiles with this one in the place of the same pad's; the newest last, so that the oldest is the first to go. */
export function withProfile(profiles: readonly PadProfile[], profile: PadProfile): PadProfile[] {
  return [...profiles.filter((each) => each.id !== profile.id), profile];
}
