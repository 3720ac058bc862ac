import type { Quality } from "../protocol/wire";

type StreamQuality = Quality["streams"][number];

const REASONS: Readonly<Record<string, string>> = {
  "no feedback": "no reports arrived from this page",
  loss: "the network loses packets",
  gap: "pictures came close to the tolerance",
  bandwidth: "the network carries no more",
  "round trip": "packets queue in the network",
};

/** One stream's pictures in words: "640×480 · 15 of 30 pictures/s · 1.2 Mbit/s"; all of them: "30 pictures/s". */
export function streamQualityLabel(stream: StreamQuality): string {
  const { width, height, frames_per_second: rate, bits_per_second: bits } = stream;
  const of =
    rate < 0.95 * stream.camera_frames_per_second ? ` of ${figure(stream.camera_frames_per_second)}` : "";
  return `${width}×${height} · ${figure(rate)}${of} pictures/s · ${bitRate(bits)}`;
}

/** What limits the quality; null when nothing does. */
export function qualityLimitLabel(quality: Quality | null): string | null {
  if (quality === null) return null;
  const reasons = quality.reason === "" ? [] : [REASONS[quality.reason] ?? quality.reason];
  if (quality.crowd > 0)
    reasons.push(`fewer pictures for each observer while more than ${quality.crowd} watch`);
  return reasons.length === 0 ? null : `Limited: ${reasons.join("; ")}`;
}

function bitRate(bits: number): string {
  return bits < 950_000 ? `${Math.round(bits / 1000)} kbit/s` : `${(bits / 1_000_000).toFixed(1)} Mbit/s`;
}

function figure(value: number): string {
  return String(Math.round(value * 10) / 10);
}
