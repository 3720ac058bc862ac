import { describe, expect, it } from "vitest";
import type { SpanName, WaySummary } from "../../src/charts/way_summary";
import { wayGroups } from "../../src/headset/way_groups";

function summaryOf(spans: Partial<Record<SpanName, number>>): WaySummary {
  const parts = Object.entries(spans).map(([name, ms]) => ({
    ...{ name: name as SpanName, clock: "page" as const },
    ...{ ms, p95Ms: ms },
  }));
  return { count: 1, parts, totalMs: 0, slowest: null, hasRemainder: true };
}

describe("a picture's way in the headset's view", () => {
  it("is few groups in the order of the way, with the headset's own part at the end", () => {
    const summary = summaryOf({
      ...{ capture_ms: 10, encoder_wait_ms: 1, encode_ms: 4, send_ms: 2 },
      ...{ between_ms: 30, transform_ms: 1, decode_ms: 6, gate_ms: 2, draw_ms: 1 },
    });
    expect(wayGroups(summary, 8)).toEqual([
      { name: "Capture", ms: 10 },
      { name: "Encode", ms: 7 },
      { name: "Network", ms: 30 },
      { name: "Decode", ms: 7 },
      { name: "Gate", ms: 3 },
      { name: "Headset", ms: 8 },
    ]);
  });

  it("says that the decoder is in the network's part where the browser does not tell it apart", () => {
    expect(wayGroups(summaryOf({ between_ms: 30 }), null)).toEqual([{ name: "Network, decode", ms: 30 }]);
  });

  it("is the headset's part alone before anything was traced, and nothing before a picture", () => {
    expect(wayGroups(null, 8)).toEqual([{ name: "Headset", ms: 8 }]);
    expect(wayGroups(null, null)).toEqual([]);
  });
});
