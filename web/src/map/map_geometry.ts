/** A pose in a plane: x and y in m, yaw in rad. */
export type PlanarPose = readonly [number, number, number];
export type Point = readonly [number, number];

/** What of the map is seen: the place in the middle of the view, and how large a metre is. The y axis points up. */
export interface Viewport {
  readonly x: number; // m
  readonly y: number; // m
  readonly scale: number; // pixels per m
}

export interface Size {
  readonly width: number; // pixels
  readonly height: number;
}

/** A rectangle of the map, in m. */
export interface Extent {
  readonly left: number;
  readonly low: number;
  readonly right: number;
  readonly high: number;
}

const LEAST_SCALE = 0.5; // pixels per m
const MOST_SCALE = 2000;
const FILLED = 0.94; // of the view

/** The pose `inner`, given in the frame `outer`, in the frame in which `outer` is given. */
export function compose(outer: PlanarPose, inner: PlanarPose): PlanarPose {
  const [cos, sin] = [Math.cos(outer[2]), Math.sin(outer[2])];
  return [
    outer[0] + cos * inner[0] - sin * inner[1],
    outer[1] + sin * inner[0] + cos * inner[1],
    turned(outer[2] + inner[2]),
  ];
}

/** The same angle from -π to π. */
export function turned(angle: number): number {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}

export function toScreen(view: Viewport, size: Size, [x, y]: Point): Point {
  return [size.width / 2 + (x - view.x) * view.scale, size.height / 2 - (y - view.y) * view.scale];
}

export function toMap(view: Viewport, size: Size, [x, y]: Point): Point {
  return [view.x + (x - size.width / 2) / view.scale, view.y - (y - size.height / 2) / view.scale];
}

/** The view in which the whole extent is seen. `above`, `below`: pixels at its edges that are covered. */
export function fitted(extent: Extent, size: Size, above = 0, below = 0): Viewport {
  const [width, height] = [extent.right - extent.left, extent.high - extent.low];
  const scale =
    FILLED *
    Math.min(size.width / Math.max(width, 1e-6), (size.height - above - below) / Math.max(height, 1e-6));
  const shown = bounded(scale);
  return {
    x: (extent.left + extent.right) / 2,
    y: (extent.low + extent.high) / 2 + (above - below) / 2 / shown,
    scale: shown,
  };
}

/** Moved by so many pixels: what was under the pointer stays under it. */
export function panned(view: Viewport, dx: number, dy: number): Viewport {
  return { ...view, x: view.x - dx / view.scale, y: view.y + dy / view.scale };
}

/** Larger by the factor; what is at this place of the view stays there. */
export function zoomed(view: Viewport, size: Size, at: Point, factor: number): Viewport {
  const scale = bounded(view.scale * factor);
  const [x, y] = toMap(view, size, at);
  const moved = { ...view, scale };
  const [movedX, movedY] = toMap(moved, size, at);
  return { x: view.x + x - movedX, y: view.y + y - movedY, scale };
}

/** The extent of a grid whose first cell's corner has this pose. */
export function gridExtent(origin: PlanarPose, width: number, height: number): Extent {
  const corners = (
    [
      [0, 0],
      [width, 0],
      [0, height],
      [width, height],
    ] as const
  ).map(([x, y]) => compose(origin, [x, y, 0]));
  const [xs, ys] = [corners.map((corner) => corner[0]), corners.map((corner) => corner[1])];
  return { left: Math.min(...xs), low: Math.min(...ys), right: Math.max(...xs), high: Math.max(...ys) };
}

function bounded(scale: number): number {
  return Number.isFinite(scale) ? Math.min(MOST_SCALE, Math.max(LEAST_SCALE, scale)) : LEAST_SCALE;
}
