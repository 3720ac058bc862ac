import { describe, expect, it } from "vitest";
import { addRow, chartWindow, createChartRing, newestTime, type ChartRow } from "../../src/charts/chart_ring";

function rowAt(second: number, row: Partial<ChartRow> = {}): ChartRow {
  return {
    wallMs: second * 1000,
    epoch: "a",
    event: second,
    eventRate: 10,
    pictureDelayMs: null,
    roundTripMs: null,
    streams: [],
    ...row,
  };
}

const overview = { name: "overview", label: "Overview", kind: "video", tolerance: 4 } as const;

describe("the charts' ring", () => {
  it("is empty before the first row", () => {
    const ring = createChartRing(3);
    expect(newestTime(ring)).toBeNull();
    expect(chartWindow(ring, 0, 100).time).toEqual([]);
  });

  it("keeps the newest rows, oldest first, and forgets older ones", () => {
    const ring = createChartRing(3);
    for (const second of [1, 2, 3, 4, 5]) addRow(ring, rowAt(second));
    const window = chartWindow(ring, 0, 100);
    expect(window.time).toEqual([3, 4, 5]);
    expect(window.column("event")).toEqual([3, 4, 5]);
    expect(newestTime(ring)).toBe(5);
  });

  it("gives the rows of the wanted time, both ends included", () => {
    const ring = createChartRing(4);
    for (const second of [1, 2, 3, 4, 5, 6]) addRow(ring, rowAt(second));
    expect(chartWindow(ring, 4, 5).time).toEqual([4, 5]);
    expect(chartWindow(ring, 7, 9).time).toEqual([]);
    expect(chartWindow(ring, 9, 7).time).toEqual([]);
  });

  it("has a hole where nothing is known, also where an older row had a value", () => {
    const ring = createChartRing(2);
    addRow(ring, rowAt(1, { streams: [{ ...overview, stamp: 1, gap: 0 }] }));
    addRow(ring, rowAt(2, { event: null }));
    addRow(ring, rowAt(3, { streams: [] }));
    const window = chartWindow(ring, 0, 9);
    expect(window.column("event")).toEqual([null, 3]);
    expect(window.column("overview_stamp")).toEqual([null, null]);
    expect(window.column("nothing_of_this_name")).toEqual([null, null]);
  });

  it("has no event and no stamp before their epoch is known", () => {
    const ring = createChartRing(4);
    for (const [second, epoch] of [
      [1, ""],
      [2, "a"],
    ] as const)
      addRow(ring, rowAt(second, { epoch, streams: [{ ...overview, stamp: second, gap: 0 }] }));
    const window = chartWindow(ring, 0, 9);
    expect(window.epochs()).toEqual(["", "a"]);
    expect(window.column("event")).toEqual([null, 2]);
    expect(window.column("overview_stamp")).toEqual([null, 2]);
    expect(window.column("overview_gap")).toEqual([0, 0]);
  });

  it("keeps each stream's stamp, gap and tolerance, and knows the streams", () => {
    const ring = createChartRing(8);
    addRow(ring, rowAt(1));
    addRow(ring, rowAt(2, { streams: [{ ...overview, stamp: 2, gap: -1 }] }));
    const window = chartWindow(ring, 0, 9);
    expect(window.streams).toEqual([{ name: "overview", label: "Overview", kind: "video" }]);
    expect(window.column("overview_stamp")).toEqual([null, 2]);
    expect(window.column("overview_gap")).toEqual([null, -1]);
    expect(window.column("overview_tolerance")).toEqual([null, 4]);
  });

  it("takes a bounded number of streams", () => {
    const ring = createChartRing(4);
    const streams = Array.from({ length: 20 }, (_, at) => ({
      ...overview,
      name: `s${at}`,
      stamp: 1,
      gap: 0,
    }));
    addRow(ring, rowAt(1, { streams }));
    expect(chartWindow(ring, 0, 9).streams).toHaveLength(8);
  });

  it("says which epoch each row belongs to", () => {
    const ring = createChartRing(8);
    for (const [second, epoch] of ["", "a", "a", "b"].entries()) addRow(ring, rowAt(second, { epoch }));
    expect(chartWindow(ring, 0, 9).epochs()).toEqual(["", "a", "a", "b"]);
  });

  it("forgets names, not rows, of more epochs than it can keep", () => {
    const ring = createChartRing(100);
    for (let second = 0; second < 80; second++) addRow(ring, rowAt(second, { epoch: `e${second}` }));
    const epochs = chartWindow(ring, 0, 99).epochs();
    expect([epochs[63], epochs[64], epochs.length]).toEqual(["e63", "", 80]);
  });
});
