import type { Body, Camera, RobotDescription } from "../protocol/wire";
import { about, multiply, rotate, type Quaternion, type RigidPose, type Vector } from "../util/rigid";

const HERE: RigidPose = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };

/** `inner`, which is given in the frame of `outer`, in the frame that `outer` is given in. */
export function joined(outer: RigidPose, inner: RigidPose): RigidPose {
  const [x, y, z] = rotate(outer.orientation, inner.position);
  const [ox, oy, oz] = outer.position;
  return { position: [ox + x, oy + y, oz + z], orientation: multiply(outer.orientation, inner.orientation) };
}

/** Of a description, which has w first. */
export function ofDescribed([w, x, y, z]: readonly [number, number, number, number]): Quaternion {
  const size = Math.hypot(w, x, y, z) || 1;
  return [x / size, y / size, z / size, w / size];
}

/**
 * Where bodies are in the world, by name, when asked for one after the other: no robot's parts are all of interest.
 *
 * @param joints measured positions in the order of the description
 */
export class BodyPoses {
  private readonly bodies: ReadonlyMap<string, Body>;
  private readonly values: ReadonlyMap<string, number>;
  private readonly found = new Map<string, RigidPose | null>([["", HERE]]);

  constructor(description: RobotDescription, joints: readonly number[]) {
    this.bodies = new Map(description.bodies.map((body) => [body.name, body]));
    this.values = new Map(description.joints.map(({ name }, at) => [name, joints[at] ?? 0]));
  }

  /** null: there is no such body, or no way from it to the world. */
  of(name: string): RigidPose | null {
    const known = this.found.get(name);
    if (known !== undefined) return known;
    this.found.set(name, null); // a circle has no way to the world
    const body = this.bodies.get(name);
    const parent = body === undefined ? null : this.of(body.parent);
    const pose = body === undefined || parent === null ? null : joined(parent, this.inParent(body));
    this.found.set(name, pose);
    return pose;
  }

  /** The frame of a camera: x to the right in its picture, y down, z ahead. null: its place is not known. */
  ofCamera({ calibration: view }: Pick<Camera, "calibration">): RigidPose | null {
    const body = view === null ? null : this.of(view.body);
    if (view === null || body === null) return null;
    return joined(body, { position: view.position, orientation: ofDescribed(view.orientation) });
  }

  /** The body's joints act in list order, in its own frame, after its fixed position and orientation. */
  private inParent(body: Body): RigidPose {
    let pose: RigidPose = { position: body.position, orientation: ofDescribed(body.orientation) };
    for (const { joint, kind, axis } of body.joints)
      pose = joined(pose, moved(kind, axis, this.values.get(joint) ?? 0));
    return pose;
  }
}

function moved(kind: "revolute" | "prismatic", [x, y, z]: Vector, value: number): RigidPose {
  if (kind === "prismatic") return { ...HERE, position: [x * value, y * value, z * value] };
  const size = Math.hypot(x, y, z);
  return size === 0 ? HERE : { ...HERE, orientation: about([x / size, y / size, z / size], value) };
}
