import { isRecord } from "../protocol/schema_check";
import type { PlanarPose } from "./map_geometry";

/** A map that can be drawn. */
export interface GridMap {
  readonly id: string;
  readonly width: number; // cells
  readonly height: number;
  readonly resolution: number; // m
  readonly origin: PlanarPose; // of the outer corner of cell (0, 0)
  readonly cells: Uint8Array; // along x and then along y: 0 (free) to 100 (occupied), 255 (not known)
}

const MAX_CELLS = 1 << 20;
const MAX_BASE64 = 64 << 10;
const UNKNOWN = 255;

/** Reads the answer of GET /api/map. Raises an error for anything that is no map. */
export async function readMap(answer: unknown): Promise<GridMap> {
  const map = isRecord(answer) ? answer["map"] : undefined;
  if (!isRecord(map)) throw new Error("no map");
  const { id, width, height, resolution, origin, cells } = map;
  if (typeof id !== "string" || typeof cells !== "string" || cells.length > MAX_BASE64)
    throw new Error("no map");
  if (!isCount(width) || !isCount(height) || width * height > MAX_CELLS) throw new Error("no size of a map");
  if (typeof resolution !== "number" || !(resolution > 0 && resolution <= 1000))
    throw new Error("no resolution");
  if (!Array.isArray(origin) || origin.length !== 3 || !origin.every((each) => Number.isFinite(each)))
    throw new Error("no origin");
  const [x, y, yaw] = origin as [number, number, number];
  const plain = await inflated(bytesOf(cells), width * height);
  return { id, width, height, resolution, origin: [x, y, yaw], cells: plain };
}

function isCount(value: unknown): value is number {
  return typeof value === "number" && Number.isInteger(value) && value >= 1;
}

function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let index = 0; index < text.length; index += 1) bytes[index] = text.charCodeAt(index);
  return bytes;
}

/** Exactly so many bytes; never more memory than that, whatever was packed. */
async function inflated(packed: Uint8Array<ArrayBuffer>, size: number): Promise<Uint8Array> {
  const reader = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate")).getReader();
  const plain = new Uint8Array(size);
  let filled = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    if (filled + value.length > size) {
      void reader.cancel();
      throw new Error("more cells than the map has");
    }
    plain.set(value, filled);
    filled += value.length;
  }
  if (filled !== size) throw new Error("fewer cells than the map has");
  return plain;
}

/** The colours of the cells, with the row of the highest y first: RGBA. */
export function coloured({ width, height, cells }: GridMap): Uint8ClampedArray<ArrayBuffer> {
  const pixels = new Uint8ClampedArray(width * height * 4);
  for (let row = 0; row < height; row += 1) {
    for (let column = 0; column < width; column += 1) {
      const value = cells[(height - 1 - row) * width + column] ?? UNKNOWN;
      const place = 4 * (row * width + column);
      const share = value <= 100 ? value / 100 : 0;
      // Free is dark, occupied light, as the rest of the page; not known lets the ground through.
      pixels[place] = 30 + 190 * share;
      pixels[place + 1] = 38 + 185 * share;
      pixels[place + 2] = 46 + 180 * share;
      pixels[place + 3] = value === UNKNOWN ? 0 : 255;
    }
  }
  return pixels;
}
