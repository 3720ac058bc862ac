import type { Group } from "three";
import {
  ArrowHelper,
  BufferAttribute,
  BufferGeometry,
  LineBasicMaterial,
  LineLoop,
  LineSegments,
  Points,
  PointsMaterial,
  Vector3,
} from "three";
import type { Geofence, RangeRing, RobotDescription, WrenchSensor } from "../protocol/wire";
import type { ToolState } from "../robot/tool_frames";
import type { RobotModel } from "./robot_model";
import { toolSign } from "./tool_signs";

const FORCE = 0xffb020;
const SEEN = 0x40c8ff;
const RAY = 0x2b5f80;
const KEEP_IN = 0x40c88c;
const KEEP_OUT = 0xff6050;
const CALM = 0.45; // opacity of a zone that does not act
const LIFT = 0.006; // of the robot's size: zones lie above the floor
const ARROW = 0.9; // of the robot's size, at full scale
const SHORTEST = 0.18;

/** What a feedback says besides joints. */
export interface SceneState extends ToolState {
  readonly wrench: readonly number[];
  readonly ranges: readonly number[];
  readonly limits: readonly string[]; // names of the zones that act
}

/** A part of the scene that shows what was measured. */
interface Sign {
  show(state: SceneState): void;
}

/** The measured force, what the range sensors saw, and the zones. `size`: of the robot, m. */
export function addAnnotations(model: RobotModel, description: RobotDescription, size: number): Sign[] {
  const signs: Sign[] = [];
  const { wrench, ranges } = description;
  const hand = wrench === null ? undefined : model.bodies.get(wrench.body);
  if (wrench !== null && hand !== undefined) signs.push(forceArrow(hand, wrench, size));
  const ring = ranges === null ? undefined : model.bodies.get(ranges.body);
  if (ranges !== null && ring !== undefined) signs.push(rangeRays(ring, ranges));
  if (description.poses.length > 0) signs.push(toolSign(model, description, size));
  for (const fence of description.geofences)
    if (fence.polygon.length > 1) signs.push(zone(model.root, fence, size));
  return signs;
}

function forceArrow(body: Group, sensor: WrenchSensor, size: number): Sign {
  const arrow = new ArrowHelper(new Vector3(1, 0, 0), new Vector3(), size, FORCE);
  arrow.visible = false;
  body.add(arrow);
  return {
    show({ wrench }) {
      const [x = 0, y = 0, z = 0] = wrench;
      const force = new Vector3(x, y, z);
      const amount = force.length();
      arrow.visible = wrench.length >= 3 && amount > 0 && amount >= sensor.threshold_force;
      if (!arrow.visible) return;
      const share = sensor.full_scale_force > 0 ? Math.min(1, amount / sensor.full_scale_force) : 1;
      const length = size * Math.max(SHORTEST, ARROW * share);
      arrow.setDirection(force.normalize());
      arrow.setLength(length, 0.25 * length, 0.14 * length);
    },
  };
}

/** From the ring to what each of its sensors saw. */
function rangeRays(body: Group, ring: RangeRing): Sign {
  const ends = new BufferAttribute(new Float32Array(3 * ring.count), 3);
  const lines = new BufferAttribute(new Float32Array(6 * ring.count), 3);
  const points = new Points(
    new BufferGeometry().setAttribute("position", ends),
    new PointsMaterial({ color: SEEN, size: 5, sizeAttenuation: false }),
  );
  const rays = new LineSegments(
    new BufferGeometry().setAttribute("position", lines),
    new LineBasicMaterial({ color: RAY }),
  );
  points.frustumCulled = rays.frustumCulled = false; // their ends are others at every event
  body.add(points, rays);
  return {
    show({ ranges }) {
      let seen = 0;
      for (const [number, distance] of ranges.slice(0, ring.count).entries()) {
        if (!(distance >= ring.range_min && distance < ring.range_max)) continue;
        const angle = ring.angle_min + number * ring.angle_increment;
        ends.setXYZ(seen, distance * Math.cos(angle), distance * Math.sin(angle), 0);
        lines.setXYZ(2 * seen + 1, distance * Math.cos(angle), distance * Math.sin(angle), 0);
        seen++;
      }
      ends.needsUpdate = lines.needsUpdate = true;
      points.geometry.setDrawRange(0, seen);
      rays.geometry.setDrawRange(0, 2 * seen);
    },
  };
}

function zone(world: Group, fence: Geofence, size: number): Sign {
  const corners = fence.polygon.map(([x, y]) => new Vector3(x, y, LIFT * size));
  const material = new LineBasicMaterial({
    color: fence.kind === "keep_out" ? KEEP_OUT : KEEP_IN,
    transparent: true,
    opacity: CALM,
  });
  world.add(new LineLoop(new BufferGeometry().setFromPoints(corners), material));
  return { show: ({ limits }) => void (material.opacity = limits.includes(fence.name) ? 1 : CALM) };
}
