/** x, y, z; m, or rad for rotation vectors. */
export type Vector = readonly [number, number, number];
/** x, y, z, w; of length 1. */
export type Quaternion = readonly [number, number, number, number];

export interface RigidPose {
  readonly position: Vector;
  readonly orientation: Quaternion;
}

/** First `right`, then `left`. */
export function multiply(left: Quaternion, right: Quaternion): Quaternion {
  const [ax, ay, az, aw] = left;
  const [bx, by, bz, bw] = right;
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** The rotation back. */
export function inverse([x, y, z, w]: Quaternion): Quaternion {
  return [-x, -y, -z, w];
}

export function rotate(rotation: Quaternion, [x, y, z]: Vector): Vector {
  const [rx, ry, rz] = multiply(multiply(rotation, [x, y, z, 0]), inverse(rotation));
  return [rx, ry, rz];
}

/** By `angle` rad about the unit vector `axis`. */
export function about(axis: Vector, angle: number): Quaternion {
  const sine = Math.sin(angle / 2);
  return [axis[0] * sine, axis[1] * sine, axis[2] * sine, Math.cos(angle / 2)];
}

export function difference(left: Vector, right: Vector): Vector {
  return [left[0] - right[0], left[1] - right[1], left[2] - right[2]];
}

export function distance(left: Vector, right: Vector): number {
  return Math.hypot(...difference(left, right));
}

/** Axis times angle, of the turn that is at most half a revolution. */
export function rotationVector(rotation: Quaternion): Vector {
  const [x, y, z, w] =
    rotation[3] < 0 ? (rotation.map((part) => -part) as [number, number, number, number]) : rotation;
  const sine = Math.hypot(x, y, z);
  const factor = sine < 1e-9 ? 2 : (2 * Math.atan2(sine, w)) / sine;
  return [x * factor, y * factor, z * factor];
}

export function ofRotationVector(vector: Vector): Quaternion {
  const angle = Math.hypot(...vector);
  if (angle < 1e-12) return [0, 0, 0, 1];
  return about([vector[0] / angle, vector[1] / angle, vector[2] / angle], angle);
}

/**
 * The rotation vector that means the same as `vector` and lies nearest to `near`: whole revolutions about its axis are
 * added, so that a turn through half a revolution goes on and does not come out at the other side.
 */
export function nearestRotationVector(vector: Vector, near: Vector): Vector {
  const angle = Math.hypot(...vector);
  const axis = angle < 1e-9 ? unit(near) : unit(vector);
  if (axis === null) return vector;
  const along = axis[0] * near[0] + axis[1] * near[1] + axis[2] * near[2];
  const turned = angle + 2 * Math.PI * Math.round((along - angle) / (2 * Math.PI));
  return [axis[0] * turned, axis[1] * turned, axis[2] * turned];
}

/** Which way a WebXR pose looks: rad about the vertical (+y), 0 along -z, to the left positive. */
export function heading(orientation: Quaternion): number {
  const [x, , z] = rotate(orientation, [0, 0, -1]);
  if (Math.hypot(x, z) > 1e-3) return Math.atan2(-x, -z);
  const [up, , back] = rotate(orientation, [0, 1, 0]); // it looks straight up or down: where the top of the head points
  return Math.atan2(-up, -back);
}

function unit(vector: Vector): Vector | null {
  const size = Math.hypot(...vector);
  return size < 1e-9 ? null : [vector[0] / size, vector[1] / size, vector[2] / size];
}
