import { expect, it } from "vitest";
import { pictureShare } from "../../../src/ui/robot/picture_clicks";

it("finds the place in a picture that keeps its shape on a wider canvas, and nothing beside it", () => {
  const canvas = { width: 640, height: 480, wide: 800, high: 480 };
  expect(pictureShare(canvas, 0.5, [400, 240])).toEqual([0.5, 0.5]);
  expect(pictureShare(canvas, 0.5, [80, 0])).toEqual([0, 0]);
  expect(pictureShare(canvas, 0.5, [40, 240])).toBeNull();
  expect(pictureShare(canvas, 0, [0, 480])).toEqual([0, 1]);
  expect(pictureShare({ ...canvas, wide: 0 }, 0.5, [0, 0])).toBeNull();
});
