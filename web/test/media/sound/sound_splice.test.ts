import { describe, expect, it } from "vitest";
import { crossFade, findPeriod } from "../../../src/media/sound/sound_splice";

describe("joins of sound", () => {
  it("fade from one piece to the other", () => {
    const faded = crossFade(new Float32Array(3).fill(1), new Float32Array(3));
    expect([...faded]).toEqual([0.75, 0.5, 0.25]);
  });

  it("lie a period apart, where there is one", () => {
    const sound = Float32Array.from({ length: 1000 }, (_, at) => Math.sin((2 * Math.PI * at) / 237));
    const period = findPeriod(sound, 240, 120, 600);
    expect(period.likeness).toBeGreaterThan(0.99);
    expect([473, 474, 475]).toContain(period.length); // two of them: the longest that is no longer than asked
  });

  it("are as far apart as they may be in silence", () => {
    expect(findPeriod(new Float32Array(1000), 240, 120, 600)).toEqual({ length: 600, likeness: 1 });
  });
});
