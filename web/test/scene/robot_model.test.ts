import { ArrowHelper, AxesHelper, type BufferGeometry, LineSegments } from "three";
import { describe, expect, test } from "vitest";
import { addAnnotations, type SceneState } from "../../src/scene/robot_annotations";
import { RobotModel } from "../../src/scene/robot_model";
import { shapeOf } from "../../src/scene/robot_shapes";
import type { Body, RobotDescription } from "../../src/protocol/wire";
import { goalAxisOf } from "../messages";
import { readVectors } from "../vectors";

interface Poses {
  readonly joints: readonly string[];
  readonly bodies: readonly Body[];
  readonly cases: readonly {
    readonly joints: readonly number[];
    readonly positions: Readonly<Record<string, readonly number[]>>;
  }[];
}

const poses = readVectors("poses") as Poses;

function robot(fields: Partial<RobotDescription>): RobotDescription {
  return {
    joints: [],
    bodies: [],
    wrench: null,
    ranges: null,
    geofences: [],
    poses: [],
    ...fields,
  } as RobotDescription;
}

function body(name: string, parent: string, fields: Partial<Body> = {}): Body {
  return { name, parent, position: [0, 0, 0], orientation: [1, 0, 0, 0], joints: [], geoms: [], ...fields };
}

const STILL: SceneState = { joints: [], wrench: [], goals: [], unknown: [], ranges: [], limits: [] };

describe("bodies stand where the console's own 3D scene has them", () => {
  const joints = poses.joints.map((name) => ({ name, unit: "rad" as const, minimum: null, maximum: null }));
  const model = new RobotModel(robot({ joints, bodies: poses.bodies }));
  test.each(poses.cases)("case %#", (each) => {
    model.pose(each.joints);
    for (const [name, position] of Object.entries(each.positions))
      for (const [at, value] of model.positionOf(name)?.toArray().entries() ?? [])
        expect(value).toBeCloseTo(position[at] ?? NaN, 6);
    expect(new Set(model.bodies.keys())).toEqual(new Set(Object.keys(each.positions)));
  });
});

test("bodies without a way to the world, and rings of parents, are left out", () => {
  const model = new RobotModel(
    robot({
      bodies: [body("hand", "arm"), body("arm", ""), body("lost", "none"), body("a", "b"), body("b", "a")],
    }),
  );
  expect([...model.bodies.keys()].toSorted()).toEqual(["arm", "hand"]);
});

test("the size is that of the moving parts, and never nothing", () => {
  const ball = {
    shape: "sphere",
    size: [2e-6, 0, 0],
    position: [0, 0, 0],
    orientation: [1, 0, 0, 0],
    vertices: [],
    triangles: [],
  } as const;
  const tiny = body("tip", "", { geoms: [{ ...ball, rgba: [1, 1, 1, 1] }] });
  expect(new RobotModel(robot({ bodies: [tiny] })).extent().radius).toBeCloseTo(2e-6 * Math.sqrt(3), 8);
  expect(new RobotModel(robot({})).extent().radius).toBeGreaterThan(0);
});

test("a mesh has its triangles, each with corners and normals of its own", () => {
  const geom = {
    shape: "mesh",
    size: [0, 0, 0],
    position: [0, 0, 1],
    orientation: [1, 0, 0, 0],
    rgba: [1, 1, 1, 1],
    vertices: [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1],
    triangles: [0, 1, 2, 0, 3, 1],
  } as const;
  const mesh = shapeOf(geom);
  const { position, normal } = mesh.geometry.attributes;
  expect(Array.from(position?.array ?? [])).toEqual([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0]);
  expect([normal?.getZ(0), normal?.getY(3)]).toEqual([1, 1]);
  expect(mesh.position.z).toBe(1);
});

test("the arrow shows a force from the sensor's threshold on, as long as its share of full scale", () => {
  const wrench = {
    name: "wrist",
    body: "hand",
    threshold_force: 2,
    full_scale_force: 20,
    full_scale_torque: 1,
  };
  const description = robot({ bodies: [body("hand", "")], wrench });
  const model = new RobotModel(description);
  const [sign] = addAnnotations(model, description, 1);
  const arrow = model.bodies.get("hand")?.children.find((each) => each instanceof ArrowHelper);
  sign?.show({ ...STILL, wrench: [0, 0, 1, 0, 0, 0] });
  expect(arrow?.visible).toBe(false);
  sign?.show({ ...STILL, wrench: [0, 0, 20, 0, 0, 0] });
  expect(arrow?.visible).toBe(true);
  const full = arrow?.line.scale.y ?? 0;
  sign?.show({ ...STILL, wrench: [0, 0, 10, 0, 0, 0] });
  expect((arrow?.line.scale.y ?? 0) / full).toBeCloseTo(0.5, 5);
});

test("rays end where the sensors saw something within their range", () => {
  const ranges = {
    name: "ring",
    body: "base",
    count: 4,
    angle_min: 0,
    angle_increment: Math.PI / 2,
    range_min: 0.1,
    range_max: 4,
  };
  const description = robot({ bodies: [body("base", "")], ranges });
  const model = new RobotModel(description);
  const [sign] = addAnnotations(model, description, 1);
  sign?.show({ ...STILL, ranges: [1, 2, 9, 0.01, 3] });
  const rays = model.bodies.get("base")?.children.find((each) => each instanceof LineSegments);
  const geometry = rays?.geometry as BufferGeometry | undefined;
  expect(geometry?.drawRange.count).toBe(4);
  const positions = geometry?.getAttribute("position").array ?? [];
  expect([...positions].slice(0, 6)).toEqual([0, 0, 0, 1, 0, 0]);
  expect(positions[10]).toBeCloseTo(2, 5);
});

test("a tool's frame stands where it was measured, and its goal's where that is known and somewhere else", () => {
  const names = ["x", "y", "z", "rx", "ry", "rz"] as const;
  const described = {
    ...robot({ bodies: [body("hand", "", { position: [1, 0, 0] })] }),
    axes: names.map((name) => goalAxisOf(name)),
    poses: [
      {
        ...{
          name: "tool",
          label: "Tool",
          body: "hand",
          frame: "",
          point: [0, 0, 0.1],
          instead_of: [],
          settling: 0,
        },
        ...{ position: ["x", "y", "z"], rotation: ["rx", "ry", "rz"] },
      },
    ],
  } as RobotDescription;
  const model = new RobotModel(described);
  const signs = addAnnotations(model, described, 1);
  const frames = model.root.children.filter((each) => each instanceof AxesHelper);
  const shown = (goals: SceneState["goals"]): unknown[] => {
    for (const sign of signs) sign.show({ ...STILL, goals });
    return frames.map((each) => (each.visible ? each.position.toArray() : null));
  };
  expect(frames).toHaveLength(2);
  expect(shown([0.2, 0.3, 0.4, 0, 0, 0])).toEqual([
    [1, 0, 0.1],
    [0.2, 0.3, 0.4],
  ]);
  expect(shown([1, 0, 0.1, 0, 0, 0])).toEqual([[1, 0, 0.1], null]); // it is there
  expect(shown([null, 0.3, 0.4, 0, 0, 0])).toEqual([[1, 0, 0.1], null]); // nobody knows
});
