import type { SpanClock, SpanName } from "./way_summary";

/** What a part of the way is called, and what happens in it. */
export interface SpanLabel {
  readonly label: string;
  readonly about: string;
}

export const CLOCK_LABELS: Record<SpanClock, string> = {
  bridge: "Robot",
  console: "Console",
  between: "Between the clocks",
  page: "This page",
};

const SPAN_LABELS: Record<SpanName, SpanLabel> = {
  camera_wait_ms: { label: "camera's beat", about: "from the feedback to the next capture" },
  capture_ms: { label: "capture", about: "from the moment that the picture shows until it is whole" },
  bridge_encode_ms: { label: "encode at the robot", about: "where the robot encodes its pictures" },
  link_wait_ms: { label: "wait for the robot link", about: "until the robot link takes it" },
  encoder_wait_ms: { label: "wait for the encoder", about: "from its arrival until its encoder begins" },
  encode_ms: { label: "encode", about: "decoding and resizing the source included" },
  packetise_ms: { label: "packetise", about: "cutting it into packets" },
  send_ms: { label: "to the socket", about: "encrypting its packets, up to the socket or the pacer" },
  assemble_ms: { label: "assemble", about: "from its last packet until it is whole and in order" },
  transform_ms: { label: "transform", about: "reading its event stamp" },
  decode_ms: { label: "decode", about: "until the decoded picture is there" },
  gate_ms: { label: "gate", about: "until the gate lets it pass" },
  draw_ms: { label: "draw", about: "onto the canvas" },
  between_ms: { label: "network", about: "both directions, and all that nobody measures" },
  input_ms: { label: "stick to send", about: "from the change of the input that it carries" },
  forward_ms: { label: "forward", about: "from its arrival until it is on the robot link" },
  link_ms: { label: "robot link", about: "both directions" },
  tick_wait_ms: { label: "wait for the tick", about: "from its arrival at the robot" },
  apply_ms: { label: "apply", about: "limits, and the robot's own tick" },
  rate_wait_ms: { label: "event rate", about: "while an answer would exceed the robot's event rate" },
  measure_ms: { label: "measure", about: "the robot's state, for the feedback" },
  back_ms: { label: "back", about: "from the feedback's arrival until it is sent" },
  take_ms: { label: "take", about: "from the feedback's arrival at this page" },
};

/** Where pictures pass no transform, as in Chromium, the page does not learn when the decoder got them. */
const WITH_DECODER: SpanLabel = {
  label: "network, decoder",
  about: "both directions, the browser's decoder, and all that nobody measures",
};

/** What a span is called beside the others of its way. */
export function spanLabel(name: SpanName, others: readonly SpanName[]): SpanLabel {
  const isOfPicture = others.includes("gate_ms") && !others.includes("decode_ms");
  return name === "between_ms" && isOfPicture ? WITH_DECODER : SPAN_LABELS[name];
}
