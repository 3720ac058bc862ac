import { Box3, Group, Quaternion, Sphere, Vector3 } from "three";
import type { Body, RobotDescription } from "../protocol/wire";
import { shapeOf } from "./robot_shapes";

const NEAREST = 1e-7; // m: a robot of no size is drawn as one of this size
const FARTHEST = 1e4;

/** A robot as a tree of bodies, by its description, in metres with z up. Posed by its joints. */
export class RobotModel {
  readonly root = new Group();
  readonly bodies = new Map<string, Group>();
  private readonly moving: { readonly body: Body; readonly group: Group }[] = [];
  private readonly jointNames: readonly string[];

  constructor(description: RobotDescription) {
    this.jointNames = description.joints.map((joint) => joint.name);
    for (const body of rooted(description.bodies)) {
      const group = new Group();
      for (const geom of body.geoms) group.add(shapeOf(geom));
      place(group, body, new Map());
      (this.bodies.get(body.parent) ?? this.root).add(group);
      this.bodies.set(body.name, group);
      if (body.joints.length > 0) this.moving.push({ body, group });
    }
  }

  /** `joints`: measured positions in the order of the description. */
  pose(joints: readonly number[]): void {
    const values = new Map(this.jointNames.map((name, at) => [name, joints[at] ?? 0]));
    for (const { body, group } of this.moving) place(group, body, values);
    this.root.updateMatrixWorld(true);
  }

  /** Where a body is against the robot's world, in metres; null: there is none of that name. */
  positionOf(name: string): Vector3 | null {
    const group = this.bodies.get(name);
    return group === undefined ? null : this.root.worldToLocal(group.getWorldPosition(new Vector3()));
  }

  /** What the eye follows: the body that moves first. */
  focus(): Vector3 {
    const first = this.moving[0];
    return first === undefined ? new Vector3() : (this.positionOf(first.body.name) ?? new Vector3());
  }

  /** Around the moving parts; around all where none moves. */
  extent(): Sphere {
    const box = new Box3();
    this.root.updateMatrixWorld(true);
    for (const { group } of this.moving.slice(0, 1)) box.expandByObject(group);
    if (box.isEmpty()) box.expandByObject(this.root);
    const sphere = box.getBoundingSphere(new Sphere());
    const radius = Math.min(FARTHEST, Math.max(NEAREST, sphere.radius || NEAREST));
    return new Sphere(this.root.worldToLocal(sphere.center), radius);
  }
}

/** Parents first; none without a way to the world. */
function rooted(bodies: readonly Body[]): Body[] {
  const found: Body[] = [];
  const known = new Set([""]);
  for (let before = -1; before !== found.length;) {
    before = found.length;
    for (const body of bodies)
      if (!known.has(body.name) && known.has(body.parent)) {
        known.add(body.name);
        found.push(body);
      }
  }
  return found;
}

const axis = new Vector3();
const turn = new Quaternion();

/** The body's joints act in list order, in its own frame, after its fixed position and orientation. */
function place(group: Group, body: Body, values: ReadonlyMap<string, number>): void {
  const [w, x, y, z] = body.orientation;
  group.position.fromArray([...body.position]);
  group.quaternion.set(x, y, z, w);
  for (const joint of body.joints) {
    const value = values.get(joint.joint) ?? 0;
    axis.fromArray([...joint.axis]);
    if (joint.kind === "prismatic")
      group.position.add(axis.multiplyScalar(value).applyQuaternion(group.quaternion));
    else if (axis.lengthSq() > 0) group.quaternion.multiply(turn.setFromAxisAngle(axis.normalize(), value));
  }
}
