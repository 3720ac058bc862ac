// Generated from docs/schemas/console.schema.json by `npm run generate`. Do not edit.

export const COMMAND_WAY = [
  { name: "input_ms", clock: "page" },
  { name: "between_ms", clock: "between" },
  { name: "forward_ms", clock: "console" },
  { name: "link_ms", clock: "between" },
  { name: "tick_wait_ms", clock: "bridge" },
  { name: "apply_ms", clock: "bridge" },
  { name: "rate_wait_ms", clock: "bridge" },
  { name: "measure_ms", clock: "bridge" },
  { name: "back_ms", clock: "console" },
  { name: "take_ms", clock: "page" },
] as const;

export const PICTURE_WAY = [
  { name: "camera_wait_ms", clock: "bridge" },
  { name: "capture_ms", clock: "bridge" },
  { name: "bridge_encode_ms", clock: "bridge" },
  { name: "link_wait_ms", clock: "bridge" },
  { name: "encoder_wait_ms", clock: "console" },
  { name: "encode_ms", clock: "console" },
  { name: "packetise_ms", clock: "console" },
  { name: "send_ms", clock: "console" },
  { name: "between_ms", clock: "between" },
  { name: "assemble_ms", clock: "page" },
  { name: "transform_ms", clock: "page" },
  { name: "decode_ms", clock: "page" },
  { name: "gate_ms", clock: "page" },
  { name: "draw_ms", clock: "page" },
] as const;
