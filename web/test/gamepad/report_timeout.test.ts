import { describe, expect, it } from "vitest";
import {
  createReportTimeout,
  notePadReport,
  type PadReport,
  type ReportTimeout,
} from "../../src/gamepad/report_timeout";

const LOOK_MS = 10;

const report = (timestamp: number, ...axes: number[]): PadReport => ({
  timestamp,
  axes,
  buttons: [{ value: 1 }],
});

/** Looks every 10 ms at what `pad` gives; whether it ever counted as silent. */
function watch(
  silence: ReportTimeout,
  fromMs: number,
  forMs: number,
  pad: (now: number) => PadReport,
): boolean {
  let isSilent = false;
  for (let now = fromMs; now < fromMs + forMs; now += LOOK_MS)
    isSilent = notePadReport(silence, pad(now), now) || isSilent;
  return isSilent;
}

describe("a pad that reports all the time", () => {
  const steady = (): ReportTimeout => {
    const silence = createReportTimeout();
    expect(watch(silence, 0, 3000, (now) => report(now, 0, 0))).toBe(false);
    return silence;
  };

  it("is gone when half a second passes without a report, and back with the next", () => {
    const silence = steady();
    const held = report(2990, 0, 0);
    expect(watch(silence, 3000, 490, () => held)).toBe(false);
    expect(watch(silence, 3490, 100, () => held)).toBe(true);
    expect(notePadReport(silence, report(3600, 0, 0), 3600)).toBe(false);
  });

  it("is not gone while a hand holds it still, for however long", () => {
    expect(watch(steady(), 3000, 30_000, (now) => report(now, 1, 1))).toBe(false);
  });

  it("is not gone because the page was held up and did not look", () => {
    const silence = steady();
    expect(notePadReport(silence, report(2990, 0, 0), 8000)).toBe(false);
    expect(notePadReport(silence, report(8010, 0, 0), 8010)).toBe(false);
  });
});

describe("a pad that reports changes only", () => {
  it("is never taken for gone: a stick that is held still says nothing either", () => {
    const silence = createReportTimeout();
    expect(watch(silence, 0, 5000, (now) => report(now, now / 5000))).toBe(false);
    expect(watch(silence, 5000, 20_000, () => report(4990, 0.998))).toBe(false);
  });

  it("is not known by the noise of a stick, which changes values, nor by reports now and then", () => {
    const silence = createReportTimeout();
    expect(watch(silence, 0, 5000, (now) => report(now, (now % 20) / 1000))).toBe(false);
    expect(watch(silence, 5000, 2000, () => report(4990, 0.01))).toBe(false);
    const rare = (now: number): PadReport => report(Math.floor(now / 300), 0);
    expect(watch(silence, 7000, 100_000, rare)).toBe(false);
    expect(watch(silence, 107_000, 2000, () => report(1, 0))).toBe(false);
  });
});
