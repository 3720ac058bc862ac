import { expect, it } from "vitest";
import { avcCodec } from "../../src/media/h264";
import { joined, parseList, searched, type RecordingList } from "../../src/replay/recording_list";
import { readReplayLink, replayHash, tokenIn } from "../../src/replay/replay_link";
import { atRate, decodeMuLaw, opusChannels } from "../../src/media/sound/sound_samples";

it("a link names a recording and an event", () => {
  const link = { token: "a.b.c", recording: "20270115-planar", event: 12 };
  expect(readReplayLink(replayHash(link))).toEqual(link);
  expect(readReplayLink("#token=a&event=-3")).toEqual({ token: "a", recording: null, event: null });
});

it("a token is found in a pasted link, and nothing else is taken for one", () => {
  expect(tokenIn(" https://robot.example/#token=a.b.c&name=x ")).toBe("a.b.c");
  expect(tokenIn("a.b.c")).toBe("a.b.c");
  expect(tokenIn("good morning")).toBe("");
});

it("a search finds recordings that have all of its words", () => {
  const { recordings } = parseList({
    recordings: [
      { id: "one", name: "Knot", robot: "Arm", marks: { stop: 1 } },
      { id: "two", name: "Knot", robot: "Planar robot" },
      { robot: "no id" },
    ],
  });
  expect(searched(recordings, "knot  planar").map((each) => each.id)).toEqual(["two"]);
  expect(searched(recordings, "stop").map((each) => each.id)).toEqual(["one"]);
  expect(searched(recordings, "")).toHaveLength(2);
});

it("older recordings are shown behind the newest, also when newer ones push some of these out", () => {
  const list = (older: number, ...started: number[]): RecordingList => ({
    ...parseList({ recordings: started.map((each) => ({ id: `${each}`, started: each })), older }),
  });
  const ids = (found: RecordingList): string[] => found.recordings.map((each) => each.id);
  expect(joined(list(1, 5, 4), null)).toMatchObject({ older: 1 });
  const shown = joined(list(2, 5, 4), list(0, 3, 2));
  expect([ids(shown), shown.older]).toEqual([["5", "4", "3", "2"], 0]);
  expect(ids(joined(list(3, 6, 5), shown))).toEqual(["6", "5", "4", "3", "2"]);
  expect(ids(joined(list(0, 6, 5), shown))).toEqual(["6", "5"]); // the others are deleted
});

it("the codec is read from the sequence parameter set", () => {
  expect(avcCodec(Uint8Array.of(0, 0, 0, 1, 0x67, 0x42, 0xc0, 0x1f, 0x8c))).toBe("avc1.42C01F");
  expect(avcCodec(Uint8Array.of(0, 0, 0, 1, 0x41, 1, 2, 3, 4))).toBeNull();
});

it("µ-law is decoded as in G.711", () => {
  const [silence, most, least] = decodeMuLaw(Uint8Array.of(0xff, 0x80, 0x00));
  expect(silence).toBeCloseTo(0);
  expect(most).toBeCloseTo(32124 / 32768);
  expect(least).toBeCloseTo(-32124 / 32768);
  expect([opusChannels(Uint8Array.of(0x78)), opusChannels(Uint8Array.of(0x7c))]).toEqual([1, 2]);
});

it("sound keeps its length and its shape at a higher rate", () => {
  const ramp = Float32Array.of(0, 0.5, 1);
  expect([...atRate(ramp, 8000, 16_000)]).toEqual([0, 0.25, 0.5, 0.75, 1, 1]);
  expect(atRate(ramp, 8000, 8000)).toBe(ramp);
});
