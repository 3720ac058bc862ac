import { expect, it } from "vitest";
import { limitWords, streamQualityWords } from "../../src/core/quality_words";

const stream = {
  stream: "overview",
  tier: "operator",
  width: 640,
  height: 480,
  frames_per_second: 25,
  bits_per_second: 1_234_000,
} as const;

it("quality is told in size, rate and bit rate", () => {
  expect(streamQualityWords(stream)).toBe("640×480 · 25 pictures/s · 1.2 Mbit/s");
  expect(streamQualityWords({ ...stream, frames_per_second: 7.5, bits_per_second: 96_400 })).toBe(
    "640×480 · 7.5 pictures/s · 96 kbit/s",
  );
});

it("what limits it is told in plain words, and nothing when nothing does", () => {
  const quality = (reason: string) => ({ type: "quality", streams: [stream], reason }) as const;
  expect(limitWords(null)).toBeNull();
  expect(limitWords(quality(""))).toBeNull();
  expect(limitWords(quality("bandwidth"))).toBe("Limited: the network carries no more");
  expect(limitWords(quality("something new"))).toBe("Limited: something new");
});
