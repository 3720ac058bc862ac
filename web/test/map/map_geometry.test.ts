import { describe, expect, it } from "vitest";
import {
  compose,
  fitted,
  gridExtent,
  panned,
  toMap,
  toScreen,
  zoomed,
  type Point,
} from "../../src/map/map_geometry";

const SIZE = { width: 400, height: 300 };
const VIEW = { x: 1, y: 2, scale: 50 };

function close(found: readonly number[], wanted: readonly number[]): void {
  expect(found.length).toBe(wanted.length);
  for (const [index, value] of wanted.entries()) expect(found[index]).toBeCloseTo(value, 9);
}

describe("the view of a map", () => {
  it("has the y axis pointing up, and finds a place again", () => {
    close(toScreen(VIEW, SIZE, [1, 2]), [200, 150]);
    close(toScreen(VIEW, SIZE, [2, 3]), [250, 100]);
    close(toMap(VIEW, SIZE, toScreen(VIEW, SIZE, [-3, 7])), [-3, 7]);
  });

  it("moves with the hand: what was under the pointer stays under it", () => {
    const under = toMap(VIEW, SIZE, [100, 100]);
    close(toScreen(panned(VIEW, 30, -20), SIZE, under), [130, 80]);
  });

  it("grows around the pointer, within bounds", () => {
    const at: Point = [37, 250];
    const under = toMap(VIEW, SIZE, at);
    close(toScreen(zoomed(VIEW, SIZE, at, 3), SIZE, under), at);
    expect(zoomed(VIEW, SIZE, at, 1e9).scale).toBeLessThanOrEqual(2000);
    expect(zoomed(VIEW, SIZE, at, NaN).scale).toBeGreaterThan(0);
  });

  it("shows the whole of a map that lies askew", () => {
    const extent = gridExtent([1, 1, Math.PI / 2], 4, 2);
    close([extent.left, extent.low, extent.right, extent.high], [-1, 1, 1, 5]);
    const view = fitted(extent, SIZE);
    for (const corner of [
      [-1, 1],
      [1, 5],
    ] as const) {
      const [x, y] = toScreen(view, SIZE, corner);
      expect(x).toBeGreaterThanOrEqual(0);
      expect(x).toBeLessThanOrEqual(SIZE.width);
      expect(y).toBeGreaterThanOrEqual(0);
      expect(y).toBeLessThanOrEqual(SIZE.height);
    }
  });

  it("puts a pose into the frame that its own frame is given in", () => {
    close(compose([1, 2, Math.PI / 2], [3, 0, Math.PI]), [1, 5, -Math.PI / 2]);
  });
});
