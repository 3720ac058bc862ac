import { beforeEach, describe, expect, it } from "vitest";
import { createDeviceClock, losesTime, type DeviceClock } from "../../../src/media/sound/device_clock";

let clock: DeviceClock;
let [deviceS, nowS] = [0, 0];

beforeEach(() => {
  clock = createDeviceClock();
  [deviceS, nowS] = [0, 100];
});

/** Whether the device is seen to lose time in the next `seconds`, in which it plays `share` of them. */
function losesIn(seconds: number, share: number): boolean {
  const seen = Array.from({ length: seconds * 10 }, () => {
    deviceS += share / 10;
    nowS += 0.1;
    return losesTime(clock, deviceS, nowS);
  });
  return seen.includes(true);
}

describe("the sound device's clock", () => {
  it("is seen to lose time when it plays an eighth too little for eight seconds", () => {
    expect(losesIn(6, 1)).toBe(false);
    expect(losesIn(12, 0.875)).toBe(true);
  });

  it("may stand still while the device is opened", () => {
    expect(losesIn(2, 0)).toBe(false);
    expect(losesIn(60, 1)).toBe(false);
  });

  it("may stand still once, for a moment", () => {
    expect(losesIn(20, 1)).toBe(false);
    expect(losesIn(1, 0)).toBe(false);
    expect(losesIn(60, 1)).toBe(false);
  });

  it("may be a few per mille slow", () => {
    expect(losesIn(100, 0.995)).toBe(false);
  });
});
