import {
  BufferGeometry,
  Group,
  Line,
  LineBasicMaterial,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  Raycaster,
  SphereGeometry,
  Vector3,
  type Object3D,
} from "three";
import type { Side } from "../xr/headset_input";
import type { HandReading } from "./xr_hands";

const REACH = 4; // m, of a ray
const AWAY = 0.5; // m, of one that meets nothing
const CALM = 0x8fa3b5;
const HOLDS = 0x4fd08c; // it lets the robot move

/** The rays of both hands, and what they meet. */
export class Pointers {
  readonly group = new Group();
  private readonly rays = new Map<Side, Ray>();
  private readonly caster = new Raycaster();

  /** `targets`: what can be pressed. Returns what each hand points at. */
  update(
    hands: readonly HandReading[],
    held: ReadonlySet<Side>,
    targets: readonly Object3D[],
  ): Map<Side, Object3D> {
    const met = new Map<Side, Object3D>();
    for (const side of ["left", "right"] as const) {
      const pose = hands.find(({ sample }) => sample.side === side)?.ray ?? null;
      const ray = this.rayOf(side);
      ray.group.visible = pose !== null;
      if (pose === null) continue;
      const origin = new Vector3(...pose.position);
      const turn = new Quaternion(...pose.orientation);
      this.caster.set(origin, new Vector3(0, 0, -1).applyQuaternion(turn));
      this.caster.far = REACH;
      const hit = this.caster.intersectObjects([...targets], false)[0];
      if (hit !== undefined) met.set(side, hit.object);
      ray.show(origin, turn, hit?.distance ?? null, held.has(side));
    }
    return met;
  }

  close(): void {
    for (const ray of this.rays.values()) ray.close();
  }

  private rayOf(side: Side): Ray {
    const known = this.rays.get(side);
    if (known !== undefined) return known;
    const ray = new Ray();
    this.rays.set(side, ray);
    this.group.add(ray.group);
    return ray;
  }
}

class Ray {
  readonly group = new Group();
  private readonly line = new Line(
    new BufferGeometry().setFromPoints([new Vector3(), new Vector3(0, 0, -1)]),
    new LineBasicMaterial({ color: CALM, transparent: true, opacity: 0.8 }),
  );
  private readonly dot = new Mesh(
    new SphereGeometry(0.012, 16, 8),
    new MeshBasicMaterial({ color: 0xffffff }),
  );
  private readonly hand = new Mesh(new SphereGeometry(0.012, 16, 10), new MeshBasicMaterial({ color: CALM }));

  constructor() {
    this.dot.renderOrder = 3;
    this.group.add(this.line, this.dot, this.hand);
  }

  show(origin: Vector3, turn: Quaternion, distance: number | null, holds: boolean): void {
    this.group.position.copy(origin);
    this.group.quaternion.copy(turn);
    this.line.scale.z = distance ?? AWAY;
    this.dot.visible = distance !== null;
    this.dot.position.z = -(distance ?? 0);
    this.line.material.color.setHex(holds ? HOLDS : CALM);
    this.hand.material.color.setHex(holds ? HOLDS : CALM);
  }

  close(): void {
    for (const { geometry, material } of [this.line, this.dot, this.hand]) {
      geometry.dispose();
      material.dispose();
    }
  }
}
