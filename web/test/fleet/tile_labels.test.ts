import { expect, it } from "vitest";
import { gapLabel, pictureLabel } from "../../src/fleet/tile_labels";

it("tells a gap with its tolerance, alone, or not at all", () => {
  expect([gapLabel(1, 4), gapLabel(0, null), gapLabel(null, 4)]).toEqual(["1 of 4", "0", "–"]);
});

it("veils the picture of a robot that is not known or not reached, whatever its connection says", () => {
  expect(pictureLabel("unknown", null, null)).toBe("Unknown");
  expect(pictureLabel(null, null, null)).toBe("Unknown");
  expect(pictureLabel("unreachable", null, null)).toBe("No picture");
});

it("says why there is no picture, or why it is veiled, and nothing over a live one", () => {
  expect(pictureLabel("free", "No camera", null)).toBe("No camera");
  expect(pictureLabel("stopped", null, "5 events behind")).toBe("5 events behind");
  expect(pictureLabel("driven", null, null)).toBeNull();
});
