import { expect, it } from "vitest";
import { qualityLimitLabel, streamQualityLabel } from "../../src/media/quality_labels";

const stream = {
  stream: "overview",
  tier: "operator",
  width: 640,
  height: 480,
  frames_per_second: 25,
  bits_per_second: 1_234_000,
  camera_frames_per_second: 25,
} as const;

it("quality is told in size, rate and bit rate", () => {
  expect(streamQualityLabel(stream)).toBe("640×480 · 25 pictures/s · 1.2 Mbit/s");
  expect(
    streamQualityLabel({
      ...stream,
      frames_per_second: 7.5,
      camera_frames_per_second: 0,
      bits_per_second: 96_400,
    }),
  ).toBe("640×480 · 7.5 pictures/s · 96 kbit/s");
});

it("fewer pictures than the camera gives are told as so many of them", () => {
  expect(streamQualityLabel({ ...stream, frames_per_second: 15, camera_frames_per_second: 30 })).toBe(
    "640×480 · 15 of 30 pictures/s · 1.2 Mbit/s",
  );
});

it("what limits it is told in plain words, and nothing when nothing does", () => {
  const quality = (reason: string, crowd = 0) =>
    ({ type: "quality", streams: [stream], reason, crowd }) as const;
  expect(qualityLimitLabel(null)).toBeNull();
  expect(qualityLimitLabel(quality(""))).toBeNull();
  expect(qualityLimitLabel(quality("bandwidth"))).toBe("Limited: the network carries no more");
  expect(qualityLimitLabel(quality("something new"))).toBe("Limited: something new");
  expect(qualityLimitLabel(quality("", 60))).toBe(
    "Limited: fewer pictures for each observer while more than 60 watch",
  );
  expect(qualityLimitLabel(quality("loss", 60))).toBe(
    "Limited: the network loses packets; fewer pictures for each observer while more than 60 watch",
  );
});
