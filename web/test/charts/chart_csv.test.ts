import { expect, it } from "vitest";
import { chartCsv } from "../../src/charts/chart_csv";
import { addRow, chartWindow, createChartRing } from "../../src/charts/chart_ring";

function csvOf(name: string, epoch: string): string {
  const ring = createChartRing(4);
  addRow(ring, {
    wallMs: 1_700_000_000_500,
    epoch,
    event: 7,
    eventRate: 12.34567,
    pictureDelayMs: null,
    roundTripMs: 3.5,
    streams: [{ name, label: "", kind: "video", stamp: 6, gap: 1, tolerance: 4 }],
  });
  return chartCsv(chartWindow(ring, 0, Infinity));
}

it("has a header and one line a row, empty where nothing is known", () => {
  expect(csvOf("overview", "9f3c")).toBe(
    "time,epoch,event,event_rate,picture_delay_ms,round_trip_ms,overview_stamp,overview_gap,overview_tolerance\r\n" +
      "2023-11-14T22:13:20.500Z,9f3c,7,12.346,,3.5,6,1,4\r\n",
  );
});

it("quotes what has commas or quotes, and gives a spreadsheet no formula", () => {
  expect(csvOf('a,"b', "=1+1").split("\r\n")[0]).toContain('"a,""b_stamp"');
  expect(csvOf("overview", "=1+1")).toContain("Z,'=1+1,7,");
});
