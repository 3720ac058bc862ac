import { expect, it } from "vitest";
import { gapWords, pictureWords } from "../../src/core/tile_figures";

it("tells a gap with its tolerance, alone, or not at all", () => {
  expect([gapWords(1, 4), gapWords(0, null), gapWords(null, 4)]).toEqual(["1 of 4", "0", "–"]);
});

it("veils the picture of a robot that is not known or not reached, whatever its connection says", () => {
  expect(pictureWords("unknown", null, null)).toBe("Unknown");
  expect(pictureWords(null, null, null)).toBe("Unknown");
  expect(pictureWords("unreachable", null, null)).toBe("No picture");
});

it("says why there is no picture, or why it is veiled, and nothing over a live one", () => {
  expect(pictureWords("free", "No camera", null)).toBe("No camera");
  expect(pictureWords("stopped", null, "5 events behind")).toBe("5 events behind");
  expect(pictureWords("driven", null, null)).toBeNull();
});
