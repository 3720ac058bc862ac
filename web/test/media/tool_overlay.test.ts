import { afterEach, describe, expect, it, vi } from "vitest";
import { ToolOverlay } from "../../src/media/tool_overlay";
import type { Body, Camera, Pose, RobotDescription } from "../../src/protocol/wire";
import { descriptionOf, feedbackOf, goalAxisOf } from "../messages";

const NAMES = ["x", "y", "z"] as const;
const POSE: Pose = {
  ...{ name: "tool", label: "Tool", body: "hand", frame: "", point: [0, 0, 0], instead_of: [], settling: 0 },
  ...{ position: NAMES, rotation: ["", "", ""] },
};
const HAND: Body = {
  ...{ name: "hand", parent: "", position: [0, 0, 0], orientation: [1, 0, 0, 0], geoms: [] },
  joints: [{ joint: "slide", kind: "prismatic", axis: [1, 0, 0] }],
};
/** It looks along the world's z axis, from 1 m below. */
const CAMERA: Camera = {
  ...{
    name: "front",
    label: "Front",
    width: 640,
    height: 480,
    frame_rate: 30,
    metres_per_pixel: null,
    click: "",
  },
  calibration: {
    body: "",
    position: [0, 0, -1],
    orientation: [1, 0, 0, 0],
    fx: 500,
    fy: 400,
    cx: 320,
    cy: 240,
    distortion_model: "",
    distortion: [],
  },
};

function robot(camera: Partial<Camera> = {}): RobotDescription {
  return {
    ...descriptionOf(NAMES.map((name) => goalAxisOf(name))),
    joints: [{ name: "slide", unit: "m", minimum: null, maximum: null }],
    bodies: [HAND],
    cameras: [{ ...CAMERA, ...camera }],
    poses: [POSE],
  };
}

/** What is drawn: the beginnings of lines, in the picture's own pixels. */
class Paper {
  readonly begun: (readonly [number, number])[] = [];
  readonly canvas = { width: 320, height: 240 };
  lineWidth = 1;
  lineCap = "";
  strokeStyle = "";
  private factor = [1, 1];

  save = (): void => undefined;
  restore = (): void => undefined;
  beginPath = (): void => undefined;
  lineTo = (): void => undefined;
  stroke = (): void => undefined;
  arc = (): void => undefined;
  setLineDash = (): void => undefined;
  scale = (x: number, y: number): void => void (this.factor = [x, y]);
  moveTo = (x: number, y: number): void =>
    void this.begun.push([x * (this.factor[0] ?? 1), y * (this.factor[1] ?? 1)]);
}

function painted(overlay: ToolOverlay, event: number | null, stream = "front"): Paper["begun"] {
  const paper = new Paper();
  overlay.paint(paper as unknown as CanvasRenderingContext2D, stream, event);
  return paper.begun;
}

function told(description: RobotDescription): ToolOverlay {
  const overlay = new ToolOverlay(() => description);
  overlay.take(feedbackOf(4, { joints: [0], goals: [0, 0, 0] }));
  overlay.take(feedbackOf(5, { joints: [0.2], goals: [0.2, 0, 0] }));
  return overlay;
}

afterEach(() => vi.unstubAllGlobals());

describe("a picture", () => {
  it("has the tool's frame as it was at the picture's own event, where the camera sees it", () => {
    const overlay = told(robot());
    expect(new Set(painted(overlay, 4).map(String))).toEqual(new Set(["160,120"]));
    expect(new Set(painted(overlay, 5).map(String))).toEqual(new Set(["210,120"])); // 0.2 m · 500 / 1 m, at half size
  });

  it("has none without the feedback of exactly its event: earlier, later, or unstamped", () => {
    const overlay = told(robot());
    for (const event of [3, 6, null]) expect(painted(overlay, event)).toEqual([]);
  });

  it("has none where the camera's place, a joint or the camera itself is not known", () => {
    expect(painted(told(robot({ calibration: null })), 5)).toEqual([]);
    expect(painted(told(robot()), 5, "other")).toEqual([]);
    const overlay = new ToolOverlay(() => robot());
    overlay.take(feedbackOf(4, { joints: [0], goals: [0, 0, 0], unknown: ["slide"] }));
    expect(painted(overlay, 4)).toEqual([]);
  });

  it("has none in a picture that the lens bends", () => {
    const { calibration } = CAMERA;
    if (calibration === null) throw new Error("it has a calibration");
    const bent = { ...calibration, distortion_model: "plumb_bob", distortion: [0.1, 0, 0, 0, 0] };
    expect(painted(told(robot({ calibration: bent })), 5)).toEqual([]);
  });

  it("has none of a tool behind the camera", () => {
    const { calibration: view } = CAMERA;
    if (view === null) throw new Error("it has a view");
    expect(painted(told(robot({ calibration: { ...view, position: [0, 0, 1] } })), 5)).toEqual([]);
  });

  it("has none of another robot's feedback, nor without a robot", () => {
    let description: RobotDescription | null = robot();
    const overlay = new ToolOverlay(() => description);
    overlay.take(feedbackOf(4, { joints: [0], goals: [0, 0, 0] }));
    description = robot();
    expect(painted(overlay, 4)).toEqual([]);
    description = null;
    expect(painted(overlay, 4)).toEqual([]);
  });

  it("has none while the person has hidden them, and the decision is kept", () => {
    const kept = new Map<string, string>();
    vi.stubGlobal("localStorage", {
      getItem: (key: string) => kept.get(key) ?? null,
      setItem: (key: string, value: string) => void kept.set(key, value),
    });
    const overlay = told(robot());
    expect(overlay.isOn).toBe(true);
    overlay.toggle();
    expect(painted(overlay, 5)).toEqual([]);
    const later = told(robot());
    expect(later.isOn).toBe(false);
    later.toggle();
    expect(painted(later, 5)).not.toEqual([]);
    expect(told(robot()).isOn).toBe(true);
  });

  it("can be shown and hidden where storage is switched off", () => {
    const refuse = (): never => {
      throw new Error("switched off");
    };
    vi.stubGlobal("localStorage", { getItem: refuse, setItem: refuse });
    const overlay = told(robot());
    overlay.toggle();
    expect(painted(overlay, 5)).toEqual([]);
    overlay.toggle();
    expect(painted(overlay, 5)).not.toEqual([]);
  });

  it("has the goal too while it is somewhere else", () => {
    const description = robot();
    const overlay = new ToolOverlay(() => description);
    overlay.take(feedbackOf(4, { joints: [0], goals: [-0.4, 0, 0] }));
    expect(new Set(painted(overlay, 4).map(String))).toEqual(new Set(["160,120", "60,120"]));
  });
});
