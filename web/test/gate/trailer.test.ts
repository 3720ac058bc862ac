import { describe, expect, it } from "vitest";
import { splitTrailer } from "../../src/gate/trailer";

const MAGIC = [0x4c, 0x4b, 0x54, 0x53];

function withTrailer(
  payload: readonly number[],
  tlvs: readonly number[],
  length = tlvs.length + 5,
): Uint8Array {
  return Uint8Array.from([...payload, ...tlvs.map((byte) => byte ^ 0xff), length ^ 0xff, ...MAGIC]);
}

const CAPTURE_TIME = [1, 8, 0, 0, 0, 0, 0, 0, 1, 0];
const EVENT_258 = [2, 4, 0, 0, 1, 2];

describe("the trailer", () => {
  it("gives the event and the capture time, and the payload's length", () => {
    const split = splitTrailer(withTrailer([9, 9, 9], [...CAPTURE_TIME, ...EVENT_258]));
    expect(split).toEqual({ length: 3, trailer: { event: 258, captureTimeUs: 256n } });
  });

  it("skips tags that it does not know", () => {
    const split = splitTrailer(withTrailer([1], [77, 2, 5, 5, ...EVENT_258]));
    expect(split).toEqual({ length: 1, trailer: { event: 258, captureTimeUs: null } });
  });

  it.each([
    ["event 0 is unset", [2, 4, 0, 0, 0, 0]],
    ["an event above 31 bits", [2, 4, 0x80, 0, 0, 0]],
    ["an event of a wrong size", [2, 2, 1, 1]],
    ["no event", CAPTURE_TIME],
    ["nothing", []],
  ])("%s is no stamp", (_name, tlvs) => {
    expect(splitTrailer(withTrailer([7], tlvs)).trailer?.event).toBeNull();
  });

  it.each([
    ["no magic", Uint8Array.from([1, 2, 3, 4, 5, 6])],
    ["too short", Uint8Array.from(MAGIC)],
    ["a length beyond the frame", withTrailer([], EVENT_258, 99)],
    ["a length shorter than the tail", withTrailer([], EVENT_258, 3)],
    ["a value cut off", withTrailer([], [2, 4, 0])],
    ["a tag cut off", withTrailer([], [2])],
  ])("%s leaves the frame whole", (_name, data) => {
    expect(splitTrailer(data)).toEqual({ length: data.length, trailer: null });
  });

  it("reads any bytes without failing", () => {
    let seed = 1;
    const next = (): number => (seed = (seed * 48271) % 0x7fffffff);
    for (let round = 0; round < 2000; round++) {
      const tlvs = Array.from({ length: next() % 24 }, () => next() & 0xff);
      const data = withTrailer([1, 2], tlvs, next() % 40);
      const { length } = splitTrailer(data);
      expect(length).toBeGreaterThanOrEqual(0);
      expect(length).toBeLessThanOrEqual(data.length);
    }
  });
});
