import { DEFAULT_HAND, type HandSettings } from "./hand_mapping";

export const SCALES: readonly number[] = [0.25, 0.5, 1, 1.5, 2];
/** Where the camera looks in the robot's frame, in degrees to the left of ahead. */
export const VIEWS: readonly number[] = [0, 90, 180, -90];

/** The settings that a text holds, with the defaults for what it lacks or has wrong. */
export function readHandSettings(text: string | null): HandSettings {
  let found: unknown = null;
  try {
    found = JSON.parse(text ?? "null");
  } catch {
    // somebody else's text
  }
  const { scale, view, locked } = partsOf(found);
  const { x, y, z, rotation } = partsOf(locked);
  return {
    scale: typeof scale === "number" && SCALES.includes(scale) ? scale : DEFAULT_HAND.scale,
    view: typeof view === "number" && VIEWS.includes(toDegrees(view)) ? view : DEFAULT_HAND.view,
    locked: { x: x === true, y: y === true, z: z === true, rotation: rotation === true },
  };
}

export function toDegrees(radians: number): number {
  return Math.round((radians * 180) / Math.PI);
}

export function toRadians(degrees: number): number {
  return (degrees * Math.PI) / 180;
}

function partsOf(value: unknown): Readonly<Record<string, unknown>> {
  return typeof value === "object" && value !== null ? (value as Record<string, unknown>) : {};
}
