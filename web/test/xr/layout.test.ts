import { describe, expect, it } from "vitest";
import { layoutPanels } from "../../src/xr/panel_layout";
import { pairStreams } from "../../src/xr/stereo_pairs";
import { readHandSettings } from "../../src/xr/hand_settings";
import { DEFAULT_HAND } from "../../src/xr/hand_mapping";
import { readGesture } from "../../src/xr/hand_gesture";
import type { Vector } from "../../src/util/rigid";

describe("cameras", () => {
  it("whose names end in left and right are a pair, whatever stands before it", () => {
    expect(pairStreams(["overview", "head.left", "wrist", "head.right"])).toEqual([
      { name: "overview", left: "overview", right: "overview" },
      { name: "head", left: "head.left", right: "head.right" },
      { name: "wrist", left: "wrist", right: "wrist" },
    ]);
    expect(pairStreams(["eye_left", "eye_right"])).toEqual([
      { name: "eye", left: "eye_left", right: "eye_right" },
    ]);
  });

  it("without their other half are single", () => {
    const single = ["head.left", "head_right", "left", "rear.right"];
    expect(pairStreams(single).map(({ left, right }) => [left, right])).toEqual(
      single.map((each) => [each, each]),
    );
  });
});

describe("panels", () => {
  it("stand at one distance, face the operator, and do not cover each other", () => {
    const places = layoutPanels([4 / 3, 4 / 3, 16 / 9, 1, 4 / 3]);
    const [main, ...small] = places;
    expect(main).toMatchObject({ x: 0, turn: 0 });
    for (const { x, z, turn } of small) {
      expect(Math.hypot(x, z)).toBeCloseTo(1.6);
      expect(Math.atan2(-x, -z)).toBeCloseTo(turn);
    }
    expect(new Set(places.map(({ x, y }) => `${x.toFixed(2)} ${y.toFixed(2)}`)).size).toBe(5);
    const edge = (main?.width ?? 0) / 2;
    for (const { x, z, width } of small) {
      const inner = Math.atan2(Math.abs(x), -z) - Math.atan2(width / 2, 1.6);
      expect(inner).toBeGreaterThan(Math.atan2(edge, 1.6) - 1e-9);
    }
  });

  it("keep the shape of the picture", () => {
    for (const { width, height } of layoutPanels([16 / 9, 16 / 9]))
      expect(width / height).toBeCloseTo(16 / 9);
    expect(layoutPanels([NaN])[0]?.width).toBeGreaterThan(1);
  });
});

describe("the settings of the hands", () => {
  it("are what was kept, and the defaults for what is wrong or missing", () => {
    expect(readHandSettings(null)).toEqual(DEFAULT_HAND);
    expect(readHandSettings("{")).toEqual(DEFAULT_HAND);
    expect(readHandSettings('{"scale": 1e9, "view": "x", "locked": 3}')).toEqual(DEFAULT_HAND);
    const kept = { scale: 0.5, view: Math.PI, locked: { x: true, y: false, z: false, rotation: true } };
    expect(readHandSettings(JSON.stringify(kept))).toEqual(kept);
  });
});

describe("a hand without a controller", () => {
  const knuckles = { middle: 0, ring: -0.02, pinky: -0.04 };

  /** `reach`: of the three fingers from the wrist, m. */
  function joints(reach: number, apart: number): Map<string, Vector> {
    const found = new Map<string, Vector>([
      ["wrist", [0, 0, 0]],
      ["thumb-tip", [0.05, 0.1, 0]],
      ["index-finger-tip", [0.05, 0.1 + apart, 0]],
    ]);
    for (const [finger, x] of Object.entries(knuckles)) {
      found.set(`${finger}-finger-phalanx-proximal`, [x, 0.09, 0]);
      found.set(`${finger}-finger-tip`, [x, reach, 0]);
    }
    return found;
  }

  const read = (places: Map<string, Vector>): ReturnType<typeof readGesture> =>
    readGesture((name) => places.get(name) ?? null);

  it("squeezes when middle, ring and little finger are closed, and pinches with thumb and index finger", () => {
    expect(read(joints(0.17, 0.1))).toEqual({ squeeze: 0, pinch: 0 });
    expect(read(joints(0.07, 0.1))).toEqual({ squeeze: 1, pinch: 0 });
    expect(read(joints(0.17, 0.01))).toEqual({ squeeze: 0, pinch: 1 });
  });

  it("does not squeeze with one finger open", () => {
    const places = joints(0.07, 0.1);
    places.set("ring-finger-tip", [-0.02, 0.17, 0]);
    expect(read(places)?.squeeze).toBe(0);
  });

  it("of which a joint is not tracked says nothing", () => {
    const places = joints(0.07, 0.1);
    places.delete("pinky-finger-tip");
    expect(read(places)).toBeNull();
  });
});
