import { describe, expect, it } from "vitest";
import { splitSounds } from "../../src/core/sound_packets";

const ONE = [2, 0xff, 0xff, 0xff, 0xff, 0, 3, 7, 8, 9];

describe("a message of sound", () => {
  it("holds one packet or several", () => {
    const packet = { stream: 2, time: 0xffffffff, data: Uint8Array.from([7, 8, 9]) };
    expect(splitSounds(Uint8Array.from(ONE))).toEqual([packet]);
    expect(splitSounds(Uint8Array.from([...ONE, ...ONE]))).toEqual([packet, packet]);
  });

  it("is read as far as it is whole", () => {
    expect(splitSounds(Uint8Array.from([]))).toEqual([]);
    for (let cut = 1; cut < ONE.length; cut++) {
      expect(splitSounds(Uint8Array.from(ONE.slice(0, cut)))).toEqual([]);
      expect(splitSounds(Uint8Array.from([...ONE, ...ONE.slice(0, cut)]))).toHaveLength(1);
    }
  });

  it("may stand anywhere in what it came in", () => {
    const message = Uint8Array.from([0, 0, ...ONE]).subarray(2);
    expect(splitSounds(message)[0]?.data).toEqual(Uint8Array.from([7, 8, 9]));
  });
});
