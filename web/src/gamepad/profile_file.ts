import {
  ACTIONS,
  CROSS,
  STICKS,
  TRIGGERS,
  type PadLayout,
  type PressSource,
  type StickSource,
} from "./layout";
import { boundedShaping } from "./shaping";
import type { PadProfile } from "./profile";
import { isRecord } from "../protocol/schema_check";

export const STORE_VERSION = 1;
export const MAX_PROFILES = 32;
/** No profile file is larger: what is read from a file comes from anywhere. */
export const MAX_STORE_CHARS = 200_000;
const MAX_INDEX = 127;
const MAX_ID = 256;

/** All that the page keeps of pads between visits. */
export interface PadProfiles {
  readonly profiles: readonly PadProfile[];
  readonly preferred: string | null; // Gamepad.id of the pad that was chosen last
}

export const NO_PROFILES: PadProfiles = { profiles: [], preferred: null };

export type ParsedProfiles =
  { readonly kind: "profiles"; readonly book: PadProfiles } | { readonly kind: "bad"; readonly why: string };

export function writeProfiles(book: PadProfiles): string {
  const profiles = book.profiles.slice(-MAX_PROFILES);
  return JSON.stringify(
    { format: "lockstep-pads", version: STORE_VERSION, preferred: book.preferred, profiles },
    null,
    1,
  );
}

/** Reads what was stored or exported. One bad profile spoils the whole: half of it would be a surprise. */
export function readProfiles(text: string): ParsedProfiles {
  if (text.length > MAX_STORE_CHARS) return { kind: "bad", why: "the content is too long" };
  let found: unknown;
  try {
    found = JSON.parse(text);
  } catch {
    return { kind: "bad", why: "the content is not JSON" };
  }
  if (!isRecord(found) || found["format"] !== "lockstep-pads")
    return { kind: "bad", why: "the content is not a file of pad profiles" };
  if (found["version"] !== STORE_VERSION) return { kind: "bad", why: "the content is of another version" };
  const { profiles, preferred } = found;
  if (!Array.isArray(profiles) || profiles.length > MAX_PROFILES)
    return { kind: "bad", why: "the profiles are not a list, or too many" };
  const read = profiles.map(readProfile);
  const bad = read.findIndex((profile) => profile === null);
  if (bad >= 0) return { kind: "bad", why: `profile ${bad + 1} is damaged` };
  const kept = read.filter((profile) => profile !== null);
  return { kind: "profiles", book: { profiles: kept, preferred: isId(preferred) ? preferred : null } };
}

/** The imported profiles win over those of the same pads. */
export function mergeProfiles(book: PadProfiles, imported: PadProfiles): PadProfiles {
  const ids = new Set(imported.profiles.map((profile) => profile.id));
  const kept = book.profiles.filter((profile) => !ids.has(profile.id));
  return {
    profiles: [...kept, ...imported.profiles].slice(-MAX_PROFILES),
    preferred: book.preferred ?? imported.preferred,
  };
}

function readProfile(found: unknown): PadProfile | null {
  if (!isRecord(found) || !isId(found["id"])) return null;
  const shaping = boundedShaping(isRecord(found["shaping"]) ? found["shaping"] : {});
  if (found["layout"] === null) return { id: found["id"], layout: null, shaping };
  const layout = readLayout(found["layout"]);
  return layout === null ? null : { id: found["id"], layout, shaping };
}

function readLayout(found: unknown): PadLayout | null {
  if (!isRecord(found)) return null;
  const sticks = readAll(STICKS, found["sticks"], readStick);
  const triggers = readAll(TRIGGERS, found["triggers"], readPress);
  const cross = readAll(CROSS, found["cross"], readPress);
  const actions = readAll(ACTIONS, found["actions"], readPresses);
  if (sticks === null || triggers === null || cross === null || actions === null) return null;
  const presses = {
    deadman: actions.deadman ?? [],
    arm: actions.arm ?? [],
    stop: actions.stop ?? [],
    slow: actions.slow ?? [],
    turbo: actions.turbo ?? [],
    layer: actions.layer ?? [],
    action_1: actions.action_1 ?? [], // profiles from before there were actions have none
    action_2: actions.action_2 ?? [],
    episode: actions.episode ?? [],
  };
  // Without these two a pad could move the robot and not stop it.
  if (presses.deadman.length === 0 || presses.stop.length === 0) return null;
  return { sticks, triggers, cross, actions: presses };
}

/** Each name's value, null where there is none; null for the whole when one is wrong. */
function readAll<Name extends string, T>(
  names: readonly Name[],
  found: unknown,
  read: (value: unknown) => T | undefined,
): Record<Name, T | null> | null {
  if (!isRecord(found)) return null;
  const values: Partial<Record<Name, T | null>> = {};
  for (const name of names) {
    const value = found[name] ?? null;
    const known = value === null ? null : read(value);
    if (known === undefined) return null;
    values[name] = known;
  }
  return values as Record<Name, T | null>; // every name was just set
}

function readStick(found: unknown): StickSource | undefined {
  if (!isRecord(found)) return undefined;
  const { index, negative, rest, positive } = found;
  if (!isIndex(index) || !isRaw(negative) || !isRaw(rest) || !isRaw(positive)) return undefined;
  const isOrdered = (negative - rest) * (positive - rest) < 0;
  return isOrdered ? { index, negative, rest, positive } : undefined;
}

function readPresses(found: unknown): PressSource[] | undefined {
  if (!Array.isArray(found) || found.length > 4) return undefined;
  const sources = found.map(readPress);
  const known = sources.filter((source) => source !== undefined);
  return known.length === sources.length ? known : undefined;
}

function readPress(found: unknown): PressSource | undefined {
  if (!isRecord(found)) return undefined;
  const { kind, index, rest, full, value } = found;
  if (!isIndex(index)) return undefined;
  if (kind === "button") return { kind, index };
  if (kind === "hat" && isRaw(value)) return { kind, index, value };
  if (kind === "axis" && isRaw(rest) && isRaw(full) && Math.abs(full - rest) >= 0.1)
    return { kind, index, rest, full };
  return undefined;
}

function isIndex(value: unknown): value is number {
  return typeof value === "number" && Number.isInteger(value) && value >= 0 && value <= MAX_INDEX;
}

function isRaw(value: unknown): value is number {
  return typeof value === "number" && Math.abs(value) <= 4;
}

function isId(value: unknown): value is string {
  return typeof value === "string" && value !== "" && value.length <= MAX_ID;
}
