import { deflateSync } from "node:zlib";
import { describe, expect, it } from "vitest";
import { coloured, readMap } from "../../src/map/map_cells";

function answer(change: Record<string, unknown> = {}, cells = [0, 100, 255, 50, 0, 0]): unknown {
  const packed = deflateSync(Uint8Array.from(cells)).toString("base64");
  const map = { id: "ab", width: 3, height: 2, resolution: 0.1, origin: [1, 2, 0], cells: packed };
  return { map: { ...map, ...change } };
}

describe("a map from the console", () => {
  it("is read, and drawn with its highest row first", async () => {
    const map = await readMap(answer());
    expect([...map.cells]).toEqual([0, 100, 255, 50, 0, 0]);
    const pixels = coloured(map);
    const shown = (column: number, row: number): number => pixels[4 * (row * 3 + column) + 3] ?? -1;
    expect(shown(2, 1)).toBe(0); // not known
    expect(shown(0, 0)).toBe(255);
    expect(pixels[4 * 4] ?? 0).toBeGreaterThan(pixels[0] ?? 0); // occupied is lighter
  });

  it.each([
    ["nothing", null],
    ["another number of cells", answer({ width: 4 })],
    ["fewer cells", answer({ width: 1 })],
    ["a size that is none", answer({ height: 0 })],
    ["too many cells", answer({ width: 4096, height: 4096 })],
    ["cells that are not packed", answer({ cells: "AAAA" })],
    ["cells that are no base64", answer({ cells: "%%" })],
    ["no resolution", answer({ resolution: 0 })],
    ["an origin that is none", answer({ origin: [1, 2] })],
  ])("is refused with %s", async (_, given) => {
    await expect(readMap(given)).rejects.toThrow();
  });

  it("inflates no more than the map has", async () => {
    await expect(
      readMap(
        answer(
          {},
          Array.from({ length: 100_000 }, () => 0),
        ),
      ),
    ).rejects.toThrow("more cells");
  });
});
