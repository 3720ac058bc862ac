import { isRecord } from "../protocol/schema_check";

/** How a stick pushes. Shares of what the device can do. */
export interface ForceSettings {
  readonly strongest: number; // 0 to 1: no contact is felt more strongly
  readonly spring: number; // 0 to 1, towards the middle, while driving
  readonly damper: number; // 0 to 1, against motion, while driving
  readonly reversed: boolean; // the stick takes a direction for where the force goes
}

/** A stick that was chosen: its USB numbers. */
export interface StickId {
  readonly vendorId: number;
  readonly productId: number;
}

export interface KeptStick {
  readonly stick: StickId | null;
  readonly settings: ForceSettings;
}

export const SHARE_BOUNDS = {
  strongest: [0.05, 1],
  spring: [0, 1],
  damper: [0, 1],
} as const satisfies Record<Exclude<keyof ForceSettings, "reversed">, readonly [number, number]>;
export type ForceShare = keyof typeof SHARE_BOUNDS;

export const DEFAULT_FORCE: ForceSettings = { strongest: 0.2, spring: 0.15, damper: 0.1, reversed: false };
const MAX_CHARS = 1000;

/** Reads what was stored; anything else is the defaults, without a stick. */
export function readKeptStick(text: string | null): KeptStick {
  const found = parse(text);
  const given = isRecord(found) && isRecord(found["settings"]) ? found["settings"] : {};
  const share = (name: ForceShare): number => boundedShare(name, given[name]);
  const settings: ForceSettings = {
    strongest: share("strongest"),
    spring: share("spring"),
    damper: share("damper"),
    reversed: given["reversed"] === true,
  };
  return { stick: isRecord(found) ? readStick(found["stick"]) : null, settings };
}

export function writeKeptStick(kept: KeptStick): string {
  return JSON.stringify(kept);
}

/** Whether a pad of the Gamepad API (Chromium: "… Vendor: 045e Product: 001b)") is this stick. */
export function isSameDevice(gamepadId: string, { vendorId, productId }: StickId): boolean {
  const found = /Vendor: ([0-9a-f]{4}) Product: ([0-9a-f]{4})/i.exec(gamepadId);
  const [, vendor = "", product = ""] = found ?? [];
  return found !== null && parseInt(vendor, 16) === vendorId && parseInt(product, 16) === productId;
}

function boundedShare(name: ForceShare, value: unknown): number {
  const [least, most] = SHARE_BOUNDS[name];
  if (typeof value !== "number" || !Number.isFinite(value)) return DEFAULT_FORCE[name];
  return Math.max(least, Math.min(most, value));
}

function readStick(found: unknown): StickId | null {
  if (!isRecord(found)) return null;
  const { vendorId, productId } = found;
  return isUsbNumber(vendorId) && isUsbNumber(productId) ? { vendorId, productId } : null;
}

function isUsbNumber(value: unknown): value is number {
  return typeof value === "number" && Number.isInteger(value) && value >= 0 && value <= 0xffff;
}

function parse(text: string | null): unknown {
  if (text === null || text.length > MAX_CHARS) return null;
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}
