import type { Quality } from "../wire";

type StreamQuality = Quality["streams"][number];

const REASONS: Readonly<Record<string, string>> = {
  "no feedback": "nothing was heard from this page",
  loss: "the network loses packets",
  gap: "pictures came close to the tolerance",
  bandwidth: "the network carries no more",
  "round trip": "packets queue in the network",
};

/** One stream's pictures in words: "640×480 · 25 pictures/s · 1.2 Mbit/s". */
export function streamQualityWords(stream: StreamQuality): string {
  const { width, height, frames_per_second: rate, bits_per_second: bits } = stream;
  return `${width}×${height} · ${figure(rate)} pictures/s · ${bitRate(bits)}`;
}

/** What limits the quality; null when nothing does. */
export function limitWords(quality: Quality | null): string | null {
  if (quality === null || quality.reason === "") return null;
  return `Limited: ${REASONS[quality.reason] ?? quality.reason}`;
}

function bitRate(bits: number): string {
  return bits < 950_000 ? `${Math.round(bits / 1000)} kbit/s` : `${(bits / 1_000_000).toFixed(1)} Mbit/s`;
}

function figure(value: number): string {
  return String(Math.round(value * 10) / 10);
}
