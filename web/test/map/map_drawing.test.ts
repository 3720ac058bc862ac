import { expect, it } from "vitest";
import { MapDrawing, type MapScene } from "../../src/map/map_drawing";
import type { RangeRing } from "../../src/protocol/wire";

const SIZE = { width: 200, height: 100 };
const VIEW = { x: 0, y: 0, scale: 10 }; // (x, y) m is (100 + 10 x, 50 - 10 y) pixels
const EMPTY: MapScene = {
  ...{ map: null, zones: [], zoneFrame: [0, 0, 0], robot: null, radius: 0.3 },
  ...{ scan: null, path: [], goal: null, aim: null },
};
const ROBOT = "#7cbcff";
const PATH = "#4fd08c";
const SCAN = "#ff7a70";
const AIM = "#ffc24d";

/** What is drawn, each with its colour: lines and circles with their places, and squares. */
function drawn(scene: Partial<MapScene>): string[] {
  const found: string[] = [];
  let way: string[] = [];
  const at = (...values: number[]): string => values.map((value) => Math.round(value) + 0).join(",");
  const context = {
    fillStyle: "",
    strokeStyle: "",
    beginPath: () => (way = []),
    moveTo: (x: number, y: number) => way.push(`from ${at(x, y)}`),
    lineTo: (x: number, y: number) => way.push(`to ${at(x, y)}`),
    arc: (x: number, y: number, radius: number) => way.push(`circle ${at(x, y, radius)}`),
    closePath: () => way.push("closed"),
    stroke: () => found.push([context.strokeStyle, ...way].join(" ")),
    fill: () => found.push([context.fillStyle, ...way].join(" ")),
    fillRect: (x: number, y: number, width: number, height: number) =>
      found.push(`${context.fillStyle} square ${at(x, y, width, height)}`),
  };
  new MapDrawing().draw(context as unknown as CanvasRenderingContext2D, SIZE, VIEW, { ...EMPTY, ...scene });
  return found.slice(1); // without the ground
}

it("draws the path from the robot on, and nothing where there is none", () => {
  expect(drawn({})).toEqual([]);
  const path = [
    [0, 0],
    [1, 0],
    [1, 2],
  ] as const;
  expect(drawn({ path })).toEqual([`${PATH} from 100,50 to 110,50 to 110,30`]);
});

it("draws the robot where it is, as large as it is and the way it looks", () => {
  const [body, nose] = drawn({ robot: [2, -1, Math.PI / 2], radius: 1.5 });
  expect(body).toBe(`${ROBOT} circle 120,60,15`);
  expect(nose).toMatch(/from 120,60 to 120,45$/);
  expect(drawn({ robot: [2, -1, 0], radius: 0.1 })[0]).toBe(`${ROBOT} circle 120,60,7`); // still to be seen
});

it("draws the goal and what a hand aims at, each with its heading where it has one", () => {
  const [place, arrow] = drawn({ goal: [1, 1, 0] });
  expect(place).toBe(`${PATH} circle 110,40,9`);
  expect(arrow).toMatch(/^#4fd08c from 119,40 to 144,40 /);
  expect(drawn({ aim: { at: [1, 1], yaw: null } })).toEqual([`${AIM} circle 110,40,9`]);
});

it("draws what the scanner sees from the robot, but not what is out of its range", () => {
  const ring = { range_max: 5, angle_min: 0, angle_increment: Math.PI / 2 } as RangeRing;
  const seen = drawn({ robot: [1, 0, Math.PI / 2], scan: { ring, ranges: [2, 5, 1] } });
  expect(seen.slice(0, 2)).toEqual([`${SCAN} square 108,28,4,4`, `${SCAN} square 108,58,4,4`]);
  expect(drawn({ scan: { ring, ranges: [2] } })).toEqual([]); // nobody knows from where
});

it("draws the zones in the frame of the robot's pose", () => {
  const polygon = [
    [0, 0],
    [1, 0],
  ] as const;
  const zone = {
    name: "room",
    label: "Room",
    kind: "keep_in",
    polygon,
  } as unknown as MapScene["zones"][number];
  const [line] = drawn({ zones: [zone], zoneFrame: [1, 1, Math.PI / 2] });
  expect(line).toMatch(/from 110,40 to 110,30 closed$/);
});
