import { describe, expect, it } from "vitest";
import {
  createArrivals,
  createSoundBacklog,
  noteArrival,
  rtpGap,
  skipTarget,
} from "../../src/gate/sound_backlog";

const RATE = 48_000;
const MS = RATE / 1000;

describe("the sound backlog", () => {
  it("leaves nothing out while little waits", () => {
    const backlog = createSoundBacklog();
    for (let now = 0; now < 2000; now += 20)
      expect(skipTarget(backlog, (now + 240) * MS, now * MS, RATE, now, true)).toBeNull();
  });

  it("leaves out as much as waits, but for a little to play with", () => {
    const backlog = createSoundBacklog();
    expect(skipTarget(backlog, 1600 * MS, 0, RATE, 0, true)).toBeNull();
    expect(skipTarget(backlog, 1900 * MS, 300 * MS, RATE, 300, true)).toBe((1900 + 1600 - 40) * MS);
  });

  it("leaves nothing out of a buffer against jitter whose sound passes the gate, but for a second or more", () => {
    const backlog = createSoundBacklog();
    for (let now = 0; now < 2000; now += 20)
      expect(skipTarget(backlog, (now + 900) * MS, now * MS, RATE, now, false)).toBeNull();
    expect(skipTarget(backlog, 3100 * MS, 2000 * MS, RATE, 2000, false)).toBeNull();
    expect(skipTarget(backlog, 3400 * MS, 2300 * MS, RATE, 2300, false)).toBe((3400 + 1100 - 40) * MS);
  });

  it("waits until that is done before it judges again", () => {
    const backlog = createSoundBacklog();
    skipTarget(backlog, 1600 * MS, 0, RATE, 0, true);
    const target = skipTarget(backlog, 1900 * MS, 300 * MS, RATE, 300, true) ?? 0;
    expect(skipTarget(backlog, 3000 * MS, 1400 * MS, RATE, 1400, true)).toBeNull();
    expect(skipTarget(backlog, target + 40 * MS, target, RATE, 3500, true)).toBeNull();
    expect(backlog.skipTo).toBeNull();
  });

  it("does not take the jump after an outage for a backlog", () => {
    const backlog = createSoundBacklog();
    expect(skipTarget(backlog, 100 * MS, 40 * MS, RATE, 100, true)).toBeNull();
    expect(skipTarget(backlog, 2100 * MS, 100 * MS, RATE, 2100, true)).toBeNull();
    expect(skipTarget(backlog, 2200 * MS, 2140 * MS, RATE, 2200, true)).toBeNull();
    expect(skipTarget(backlog, 2500 * MS, 2440 * MS, RATE, 2500, true)).toBeNull();
  });

  it("counts across the wrap of RTP timestamps", () => {
    const backlog = createSoundBacklog();
    const playing = 2 ** 32 - 500 * MS;
    skipTarget(backlog, 500 * MS, playing, RATE, 0, true);
    expect(skipTarget(backlog, 500 * MS, playing, RATE, 300, true)).toBe((500 + 1000 - 40) * MS);
    expect(rtpGap(0, 2 ** 32 - 1)).toBe(1);
  });

  it("leaves nothing more out for sound that was dropped as too old before the decoder", () => {
    const backlog = createSoundBacklog();
    const arrivals = createArrivals();
    const skips: (number | null)[] = [];
    for (let now = 0; now < 3000; now += 20) {
      const tooOld = now > 1000 && now < 2000;
      noteArrival(arrivals, (now + 40) * MS, tooOld);
      const playing = tooOld ? 1000 : now;
      skips.push(skipTarget(backlog, arrivals.queued ?? 0, playing * MS, RATE, now, true));
    }
    expect(arrivals.dropped).toBe(49);
    expect(skips.every((skip) => skip === null)).toBe(true);
  });
});
