import { describe, expect, it } from "vitest";
import { axisPositionsOf, axisPositionLabel } from "../../src/drive/axis_positions";
import type { Feedback, PositionLimit, RobotDescription } from "../../src/protocol/wire";

function limit(joint: string, gain: number | null = 1, axes = 1): PositionLimit {
  const all = Array.from({ length: axes }, (_, index) => ({ axis: `a${index}`, gain }));
  return {
    name: `${joint}.range`,
    label: joint.toUpperCase(),
    joint,
    minimum: -90e-6,
    maximum: 110e-6,
    axes: all,
    margin: 0,
    latency: 0,
  };
}

function robot(limits: PositionLimit[]): RobotDescription {
  const joints = [
    { name: "x", unit: "m", minimum: null, maximum: null },
    { name: "y", unit: "m", minimum: null, maximum: null },
  ];
  return { position_limits: limits, joints } as unknown as RobotDescription;
}

function feedback(joints: number[], unknown: string[] = []): Feedback {
  return { joints, unknown } as unknown as Feedback;
}

describe("places", () => {
  it("are the joints that one axis alone moves", () => {
    const places = axisPositionsOf(
      robot([limit("y"), limit("x", null), limit("x", 1, 2), limit("nobody"), limit("x")]),
    );
    expect(places.map((place) => [place.label, place.joint])).toEqual([
      ["Y", 1],
      ["X", 0],
    ]);
  });

  it("are written finely enough for a step of some nanometres", () => {
    const [place] = axisPositionsOf(robot([limit("x")]));
    if (place === undefined) throw new Error("no place");
    expect(axisPositionLabel(place, feedback([38.016e-6, 0]))).toBe("38.02 µm");
    expect(axisPositionLabel(place, feedback([38.048e-6, 0]))).toBe("38.05 µm");
  });

  it("are a dash while they are not known", () => {
    const [place] = axisPositionsOf(robot([limit("x")]));
    if (place === undefined) throw new Error("no place");
    expect(axisPositionLabel(place, null)).toBe("–");
    expect(axisPositionLabel(place, feedback([]))).toBe("–");
    expect(axisPositionLabel(place, feedback([1e-6, 0], ["x"]))).toBe("–");
  });
});
