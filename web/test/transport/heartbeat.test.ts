import { describe, expect, it } from "vitest";
import { Heartbeat } from "../../src/transport/heartbeat";
import type { Report } from "../../src/protocol/wire";

const REPORT: Report = { type: "report", event: 1, armed: false, streams: [] };

/** How many messages leave in a minute. */
function beats(set: (pulse: Heartbeat) => void): number {
  let count = 0;
  const pulse = new Heartbeat({
    tell: () => ++count > 0,
    report: () => REPORT,
    lost: () => undefined,
  });
  set(pulse);
  for (let now = 0; now < 60_000; now += 10) pulse.step(now);
  return count;
}

describe("how often a connection says something on its own", () => {
  it("depends on who waits for it, and on what it goes by", () => {
    expect(beats(() => undefined)).toBe(120);
    expect(beats((pulse) => (pulse.observes = true))).toBe(60);
    expect(beats((pulse) => (pulse.isSlow = pulse.observes = true))).toBe(12);
    expect(beats((pulse) => (pulse.isSlow = pulse.isReliable = true))).toBe(4);
  });
});
