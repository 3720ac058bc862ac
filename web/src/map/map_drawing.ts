import type { Geofence, RangeRing } from "../protocol/wire";
import { coloured, type GridMap } from "./map_cells";
import { compose, toScreen, type PlanarPose, type Point, type Size, type Viewport } from "./map_geometry";

/** What is to be seen on the map. Poses and points in its frame. */
export interface MapScene {
  readonly map: GridMap | null;
  readonly zones: readonly Geofence[];
  readonly zoneFrame: PlanarPose;
  readonly robot: PlanarPose | null; // null: its place is not known
  readonly radius: number; // m, of the robot
  readonly scan: { readonly ring: RangeRing; readonly ranges: readonly number[] } | null; // of the robot's own body
  readonly path: readonly Point[];
  readonly goal: PlanarPose | null;
  readonly aim: { readonly at: Point; readonly yaw: number | null } | null; // not let go yet
}

const GROUND = "#0b0e11";
const ROBOT = "#7cbcff";
const PATH = "#4fd08c";
const SCAN = "#ff7a70";
const AIM = "#ffc24d";
const KEEP_IN = "rgb(79 208 140 / 60%)";
const KEEP_OUT = "rgb(255 122 112 / 60%)";
const LEAST_ROBOT = 7; // pixels
const ARROW = 34; // pixels

/** Draws maps on a canvas. The cells are turned into a picture once. */
export class MapDrawing {
  private picture: HTMLCanvasElement | null = null;
  private pictured: GridMap | null = null;

  draw(context: CanvasRenderingContext2D, size: Size, view: Viewport, scene: MapScene): void {
    const screen = (point: Point): Point => toScreen(view, size, point);
    context.fillStyle = GROUND;
    context.fillRect(0, 0, size.width, size.height);
    if (scene.map !== null) this.drawMap(context, screen, view, scene.map);
    for (const zone of scene.zones) {
      const points = zone.polygon.map(([x, y]) => screen(point(compose(scene.zoneFrame, [x, y, 0]))));
      line(context, points, zone.kind === "keep_in" ? KEEP_IN : KEEP_OUT, 1.5, true);
    }
    line(context, scene.path.map(screen), PATH, 3, false);
    if (scene.robot !== null && scene.scan !== null) drawScan(context, screen, scene.robot, scene.scan);
    if (scene.goal !== null) drawPlace(context, screen(point(scene.goal)), scene.goal[2], PATH);
    if (scene.aim !== null) drawPlace(context, screen(scene.aim.at), scene.aim.yaw, AIM);
    if (scene.robot !== null)
      drawRobot(
        context,
        screen(point(scene.robot)),
        scene.robot[2],
        Math.max(LEAST_ROBOT, scene.radius * view.scale),
      );
  }

  private drawMap(
    context: CanvasRenderingContext2D,
    screen: (point: Point) => Point,
    view: Viewport,
    map: GridMap,
  ): void {
    if (this.pictured !== map) this.take(map);
    if (this.picture === null) return;
    const [x, y] = screen(point(map.origin));
    const side = map.resolution * view.scale;
    context.save();
    context.imageSmoothingEnabled = side < 1;
    context.translate(x, y);
    context.rotate(-map.origin[2]);
    context.drawImage(this.picture, 0, -map.height * side, map.width * side, map.height * side);
    context.restore();
  }

  private take(map: GridMap): void {
    this.pictured = map;
    const canvas = (this.picture ??= document.createElement("canvas"));
    [canvas.width, canvas.height] = [map.width, map.height];
    canvas.getContext("2d")?.putImageData(new ImageData(coloured(map), map.width, map.height), 0, 0);
  }
}

function point(pose: PlanarPose): Point {
  return [pose[0], pose[1]];
}

function line(
  context: CanvasRenderingContext2D,
  points: readonly Point[],
  colour: string,
  width: number,
  closed: boolean,
): void {
  const [first, ...others] = points;
  if (first === undefined) return;
  context.beginPath();
  context.moveTo(...first);
  for (const each of others) context.lineTo(...each);
  if (closed) context.closePath();
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineJoin = "round";
  context.stroke();
}

function drawScan(
  context: CanvasRenderingContext2D,
  screen: (point: Point) => Point,
  robot: PlanarPose,
  { ring, ranges }: { readonly ring: RangeRing; readonly ranges: readonly number[] },
): void {
  context.fillStyle = SCAN;
  for (const [index, range] of ranges.entries()) {
    if (range >= ring.range_max) continue;
    const angle = ring.angle_min + index * ring.angle_increment;
    const [x, y] = screen(point(compose(robot, [range * Math.cos(angle), range * Math.sin(angle), 0])));
    context.fillRect(x - 2, y - 2, 4, 4);
  }
}

/** A ring with an arrow in the direction of the heading. */
function drawPlace(
  context: CanvasRenderingContext2D,
  [x, y]: Point,
  yaw: number | null,
  colour: string,
): void {
  context.strokeStyle = colour;
  context.lineWidth = 2.5;
  context.beginPath();
  context.arc(x, y, 9, 0, 2 * Math.PI);
  context.stroke();
  if (yaw === null) return;
  const [dx, dy] = [Math.cos(yaw), -Math.sin(yaw)];
  const [tipX, tipY] = [x + dx * ARROW, y + dy * ARROW];
  context.beginPath();
  context.moveTo(x + dx * 9, y + dy * 9);
  context.lineTo(tipX, tipY);
  context.moveTo(tipX - dx * 9 - dy * 6, tipY - dy * 9 + dx * 6);
  context.lineTo(tipX, tipY);
  context.lineTo(tipX - dx * 9 + dy * 6, tipY - dy * 9 - dx * 6);
  context.stroke();
}

function drawRobot(context: CanvasRenderingContext2D, [x, y]: Point, yaw: number, radius: number): void {
  context.fillStyle = ROBOT;
  context.globalAlpha = 0.85;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
  context.globalAlpha = 1;
  context.strokeStyle = GROUND;
  context.lineWidth = Math.max(2, radius / 6);
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x + Math.cos(yaw) * radius, y - Math.sin(yaw) * radius);
  context.stroke();
}
