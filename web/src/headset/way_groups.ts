import type { SpanName, WaySummary } from "../charts/way_summary";

/** A stretch of a picture's way from the camera to the eye, as the headset's view names it. */
export interface WayGroup {
  readonly name: "Capture" | "Encode" | "Network" | "Network, decode" | "Decode" | "Gate" | "Headset";
  readonly ms: number;
}

const CAPTURE: readonly SpanName[] = ["capture_ms"];
const ENCODE: readonly SpanName[] = [
  "bridge_encode_ms",
  "link_wait_ms",
  "encoder_wait_ms",
  "encode_ms",
  "packetise_ms",
  "send_ms",
];
const NETWORK: readonly SpanName[] = ["between_ms"];
const DECODE: readonly SpanName[] = ["assemble_ms", "transform_ms", "decode_ms"];
const GATE: readonly SpanName[] = ["gate_ms", "draw_ms"];

/**
 * The parts of a picture's way in few groups, and what the headset adds to it. Where the browser does not say how long
 * its decoder took, that is in the network's part.
 *
 * @param waitedMs from the canvas to the headset's frame, null while unknown
 */
export function wayGroups(summary: WaySummary | null, waitedMs: number | null): WayGroup[] {
  const groups: WayGroup[] = [];
  const add = (name: WayGroup["name"], spans: readonly SpanName[]): void => {
    const parts = summary?.parts.filter((part) => spans.includes(part.name)) ?? [];
    if (parts.length > 0) groups.push({ name, ms: parts.reduce((sum, { ms }) => sum + ms, 0) });
  };
  const knowsDecoder = summary?.parts.some(({ name }) => name === "decode_ms") === true;
  add("Capture", CAPTURE);
  add("Encode", ENCODE);
  add(knowsDecoder ? "Network" : "Network, decode", NETWORK);
  add("Decode", DECODE);
  add("Gate", GATE);
  if (waitedMs !== null) groups.push({ name: "Headset", ms: waitedMs });
  return groups;
}
