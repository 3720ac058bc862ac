import { describe, expect, it } from "vitest";
import { endLabel, endOf, figureOf, shareOf } from "../../../src/drive/goals/goal_figures";
import { axisOf, goalAxisOf } from "../../messages";

const elbow = goalAxisOf("elbow", { minimum: -2, maximum: 2 });
const table = goalAxisOf("table", { minimum: -3, maximum: 3, wrap: 6 });
const jaw = goalAxisOf("jaw", { unit: "m", minimum: 0, maximum: 0.08 });

describe("a goal axis in figures", () => {
  it("is read in degrees where the robot says radians, and in its own unit else", () => {
    expect(figureOf(elbow, -0.5)).toEqual({ main: "-28.6°", beside: "-0.50 rad" });
    expect(figureOf(elbow, -0.0001)).toEqual({ main: "0.0°", beside: "0.00 rad" });
    expect(figureOf(jaw, 0.0425)).toEqual({ main: "42.5 mm", beside: "" });
    expect(figureOf(axisOf("turn", { unit: "rad/s" }), 0.5)).toEqual({ main: "0.50 rad/s", beside: "" });
  });

  it("has short ends", () => {
    expect(endLabel(elbow, -2)).toBe("-115°");
    expect(endLabel(jaw, 0.08)).toBe("80");
    expect(endLabel(jaw, -0.08)).toBe("-80");
  });

  it("knows when it is at an end, unless it has none", () => {
    expect(endOf(elbow, 2)).toBe("maximum");
    expect(endOf(elbow, -1.995)).toBe("minimum");
    expect(endOf(elbow, 1.9)).toBeNull();
    expect(endOf(elbow, 2.5)).toBe("maximum");
    expect(endOf(table, 3)).toBeNull();
  });

  it("stands on its bar, and counted past the period too", () => {
    expect(shareOf(elbow, 0)).toBe(0.5);
    expect(shareOf(elbow, 9)).toBe(1);
    expect(shareOf(table, 3.6)).toBeCloseTo(0.1);
    expect(shareOf(table, -8)).toBeCloseTo(shareOf(table, -2));
    expect(shareOf(goalAxisOf("stuck", { minimum: 1, maximum: 1 }), 1)).toBe(0);
  });
});
