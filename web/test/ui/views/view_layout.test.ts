import { describe, expect, it } from "vitest";
import { layoutViews, smallShape, type ViewLayout, type ViewArea } from "../../../src/ui/views/view_layout";

const GAP = 12;
const CAMERA = 4 / 3;
/** The views of a page on screens that are usual, without and with charts. */
const ROOMS = [
  [1006, 470],
  [1524, 778],
  [2164, 1154],
  [600, 470],
  [880, 830],
  [640, 400],
  [664, 1130],
] as const;
const GAUGES = [[], [130], [130, 86], [130, 86, 120]];

function* rooms(): Generator<ViewArea> {
  for (const [width, height] of ROOMS)
    for (const large of [1, CAMERA, 16 / 9])
      for (const gauges of GAUGES)
        for (let count = 0; count < 6; count += 1)
          for (const shape of [1, CAMERA, 16 / 9])
            yield {
              width,
              height,
              gap: GAP,
              large,
              small: Array<number>(count).fill(shape),
              gauges,
              card: null,
            };
}

/** How wide pictures of these shapes are drawn in such a plan. */
function drawn(room: ViewArea, { run, size }: ViewLayout): { large: number; small: number } {
  const width = room.width - (run === "column" ? size + GAP : 0);
  const height = room.height - (run === "row" ? size + GAP : 0);
  const [shape = CAMERA] = room.small;
  const box = run === "row" ? size * smallShape(shape) : size;
  const small = Math.min(box, (box / smallShape(shape)) * shape);
  return { large: Math.min(width, height * room.large), small };
}

/** A column of fixed width, whatever stands in it, with views of one shape. */
function fixed(room: ViewArea): { large: number; small: number } {
  const column = Math.min(216, Math.max(150, 0.17 * room.width));
  const [shape = CAMERA] = room.small;
  return {
    large: Math.min(room.width - column - GAP, room.height * room.large),
    small: Math.min(column, (column / CAMERA) * shape),
  };
}

describe("the room of the views", () => {
  it("is all the large view's where nothing else is there", () => {
    for (const [width, height] of ROOMS)
      expect(
        layoutViews({ width, height, gap: GAP, large: CAMERA, small: [], gauges: [], card: null }),
      ).toEqual({
        run: "alone",
        size: 0,
        tight: false,
        card: false,
      });
  });

  it("makes no picture smaller than a column of fixed width does, at any size, shape and number", () => {
    for (const room of rooms()) {
      const plan = layoutViews(room);
      const now = drawn(room, plan);
      const before = fixed(room);
      expect(now.large).toBeGreaterThanOrEqual(before.large - 1);
      if (room.small.length > 0 && !plan.tight) expect(now.small).toBeGreaterThanOrEqual(before.small - 1);
    }
  });

  it("has a row only where all of it fits", () => {
    let rows = 0;
    for (const room of rooms()) {
      const { run, size } = layoutViews(room);
      if (run !== "row") continue;
      rows += 1;
      const widths = [...room.small.map((shape) => size * smallShape(shape)), ...room.gauges.map(() => 150)];
      expect(widths.reduce((sum, each) => sum + each + GAP, -GAP)).toBeLessThanOrEqual(room.width);
      expect(Math.max(0, ...room.gauges)).toBeLessThanOrEqual(size);
    }
    expect(rows).toBeGreaterThan(10);
  });

  it("is shared by the small views of a column only where they do not fit in it one below the other", () => {
    for (const room of rooms()) {
      const { run, size, tight } = layoutViews(room);
      if (run !== "column") continue;
      const stacked = room.small.reduce((sum, shape) => sum + size / smallShape(shape) + GAP, -GAP);
      if (!tight) expect(stacked).toBeLessThanOrEqual(room.height);
      else
        expect(stacked + room.gauges.reduce((sum, each) => sum + each + GAP, 0)).toBeGreaterThan(room.height);
    }
    const crowd = {
      width: 1006,
      height: 470,
      gap: GAP,
      large: CAMERA,
      small: Array<number>(5).fill(1),
      gauges: [130],
      card: null,
    };
    expect(layoutViews(crowd).tight).toBe(true);
  });

  it("beside a picture as high as the room is the column's", () => {
    const room = {
      width: 1524,
      height: 778,
      gap: GAP,
      large: CAMERA,
      small: [CAMERA],
      gauges: [],
      card: null,
    };
    const plan = layoutViews(room);
    expect(plan).toEqual({
      run: "column",
      size: Math.floor(1524 - GAP - 778 * CAMERA),
      tight: false,
      card: false,
    });
    expect(drawn(room, plan).large).toBeCloseTo(778 * CAMERA);
  });

  it("below a picture as wide as the room is the row's", () => {
    const room = {
      width: 880,
      height: 830,
      gap: GAP,
      large: CAMERA,
      small: [CAMERA, CAMERA],
      gauges: [130],
      card: null,
    };
    const plan = layoutViews(room);
    expect(plan).toEqual({ run: "row", size: 830 - GAP - 660, tight: false, card: false });
    expect(drawn(room, plan).large).toBe(880);
  });

  it("has no wider column than its views fill above the gauges", () => {
    const room = {
      width: 1524,
      height: 778,
      gap: GAP,
      large: 1,
      small: [1, CAMERA, 16 / 9],
      gauges: [130],
      card: null,
    };
    const { run, size } = layoutViews(room);
    expect(run).toBe("column");
    expect(size).toBeGreaterThan(216);
    const heights = room.small.reduce((sum, shape) => sum + size / smallShape(shape) + GAP, 130);
    expect(heights).toBeLessThanOrEqual(room.height);
    expect(heights).toBeGreaterThan(room.height - 3);
  });

  it("counts two gauges side by side once where the column has the width", () => {
    const room = {
      width: 1524,
      height: 778,
      gap: GAP,
      large: CAMERA,
      small: [CAMERA, CAMERA],
      gauges: [130, 130],
      card: null,
    };
    const { size } = layoutViews(room);
    expect(size).toBeGreaterThanOrEqual(312);
    expect(2 * (size / CAMERA + GAP) + 130).toBeLessThanOrEqual(room.height);
  });

  it("is the pictures' by half at most, and gauges alone have no more than they need", () => {
    const wide = { width: 1400, height: 300, gap: GAP, large: 1, small: [4], gauges: [], card: null };
    expect(layoutViews(wide)).toEqual({ run: "column", size: 700, tight: false, card: false });
    const gauges = { width: 1524, height: 778, gap: GAP, large: 1, small: [], gauges: [130], card: null };
    expect(layoutViews(gauges)).toEqual({ run: "column", size: 216, tight: false, card: false });
  });

  it("lets as many as four small views stand in a row on an upright phone", () => {
    const room = { width: 374, height: 380, gap: 8, large: CAMERA, small: [], gauges: [], card: null };
    for (let count = 1; count < 5; count += 1) {
      const plan = layoutViews({ ...room, small: Array<number>(count).fill(CAMERA) });
      expect(plan.run).toBe("row");
      expect(count * plan.size * CAMERA + (count - 1) * 8).toBeLessThanOrEqual(374);
    }
  });

  it("leaves gauges their width in a room as narrow as a phone's", () => {
    const room = {
      width: 459,
      height: 300,
      gap: 12,
      large: CAMERA,
      small: [CAMERA],
      gauges: [130],
      card: null,
    };
    expect(layoutViews(room)).toMatchObject({ run: "column", size: 150 });
  });

  it("takes a card into the row that one small view leaves empty, and that view grows by the room it frees", () => {
    const card = { height: 62, leastWidth: 150, leastHeight: 64 };
    const room = { width: 374, height: 362, gap: 8, large: CAMERA, small: [CAMERA], gauges: [], card: null };
    const alone = layoutViews(room);
    const together = layoutViews({ ...room, card });
    expect(alone).toMatchObject({ run: "row", card: false });
    expect(together).toMatchObject({ run: "row", card: true });
    expect(together.size).toBeGreaterThan(1.5 * alone.size);
    expect(together.size * CAMERA + 8 + card.leastWidth).toBeLessThanOrEqual(374);
    expect(together.size).toBeLessThanOrEqual(room.height + card.height - 8 - 374 / CAMERA);
  });

  it("takes the card into the row of a short phone, where the large picture gains by it", () => {
    const card = { height: 46, leastWidth: 150, leastHeight: 64 };
    const room = { width: 344, height: 238, gap: 8, large: CAMERA, small: [CAMERA], gauges: [], card };
    expect(layoutViews(room)).toEqual({ run: "row", size: 64, tight: false, card: true });
    expect(layoutViews({ ...room, card: null }).run).toBe("column");
  });

  it("leaves the card where it is when small views fill the row", () => {
    const card = { height: 62, leastWidth: 150, leastHeight: 64 };
    const small = [CAMERA, CAMERA, CAMERA];
    const room = { width: 374, height: 362, gap: 8, large: CAMERA, small, gauges: [], card };
    expect(layoutViews(room).card).toBe(false);
  });
});
