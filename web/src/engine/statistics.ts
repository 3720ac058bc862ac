import { gateState, type GateState, type Pacing } from "../drive/command_gate";
import { holdsSeat } from "../session/console_state";
import { gateReason, type GateReason } from "../drive/labels/gate_reason";
import type { GateMode } from "../gate/media_gate";
import { meanGap, type GateCounters } from "../gate/gate_counters";
import { quantile, rateOf } from "../util/samples";
import type { StopFate } from "../stop/stop_press";
import { GATE_REASON_LABELS, GATE_LABELS } from "../drive/labels/labels";
import type { ConsoleEngine } from "./console_engine";
import type { HeadsetStatistics } from "./headset_statistics";
import { stalenessOf } from "./report";
import type { StopState, StreamInfo } from "../protocol/wire";

/** One stream in `window.lockstep.stats()`. */
export interface StreamStatistics {
  readonly kind: "audio" | "video";
  readonly carrier: StreamInfo["carrier"];
  readonly codec: string;
  readonly stamp: number | null;
  readonly gap: number | null;
  readonly max_gap: number;
  readonly mean_gap: number | null;
  readonly received: number;
  readonly rendered: number;
  readonly discarded: number;
  readonly held: number;
  readonly violations: number;
  readonly frame_rate: number | null; // drawn per second; null for sound
  readonly width: number;
  readonly height: number;
}

/** `window.lockstep.stats()`, documented in docs/console-api.md. */
export interface Statistics {
  readonly peer: string | null;
  readonly role: string | null;
  readonly relay: string | null; // that media come through; null: from the console
  readonly line: boolean; // messages go by a WebSocket; false: by data channels
  readonly connected: boolean;
  readonly event: number | null;
  readonly epoch: string | null;
  readonly armed: boolean;
  readonly driving: boolean;
  readonly seat: { readonly holder: string; readonly name: string; readonly mine: boolean } | null;
  readonly gate: { readonly state: GateState | GateReason; readonly reason: string };
  readonly pacing: Pacing;
  readonly tolerance: { readonly video: number; readonly audio: number };
  readonly gate_enabled: boolean;
  readonly media_gate: GateMode;
  readonly streams: Readonly<Record<string, StreamStatistics>>;
  readonly picture_delay_ms: number | null;
  readonly picture_delay_p50_ms: number | null;
  readonly picture_delay_p95_ms: number | null;
  readonly round_trip_ms: number | null;
  readonly command_to_feedback_ms: { readonly median: number | null; readonly p99: number | null };
  readonly command_to_picture_ms: Readonly<Record<"median" | "p95" | "p99" | "maximum", number | null>>;
  readonly event_rate: number;
  readonly speed_share: number; // of full speed that the cap leaves
  readonly limits: readonly string[]; // that slow the robot now
  readonly stop: StopState;
  readonly stop_press: StopFate | null; // what became of the newest press on this page; null: nothing to tell
  readonly stale: string | null; // why the large view must not be trusted
  readonly at_rest: boolean | null;
  readonly joints: readonly number[]; // measured; empty before the first feedback
  readonly axes: Readonly<Record<string, number | null>>; // measured; null where that is not known
  readonly goals: Readonly<Record<string, number | null>>; // of the goal axes, as the robot applies them
  readonly commanded: Readonly<Record<string, number | null>>; // by this page, now; null: it stays
  readonly layer: string | null; // the control layer that is active
  readonly faults: readonly string[];
  readonly first_picture_ms: number | null;
  readonly sound: "on" | "off";
  readonly pad: { readonly id: string; readonly ready: boolean; readonly calibrated: boolean } | null;
  readonly headset: HeadsetStatistics | null; // while its session lasts
  readonly bad_messages: number;
}

export function statisticsOf(engine: ConsoleEngine, mainStream: string | null): Statistics {
  const { state } = engine;
  const { driver, arming } = engine.driving;
  const now = performance.now();
  const main = mainStream === null ? undefined : engine.streams.videos.get(mainStream);
  const { seat, settings } = state;
  return {
    peer: state.welcome?.peer ?? null,
    role: state.welcome?.role ?? null,
    relay: engine.streams.relay,
    line: engine.peer?.isReliable === true,
    connected: state.welcome !== null,
    event: state.feedback?.event ?? null,
    epoch: state.robot?.epoch ?? null,
    armed: arming.state !== "disarmed",
    driving: arming.state === "driving",
    seat: seat === null ? null : { holder: seat.holder, name: seat.name, mine: holdsSeat(state) },
    gate: gateOf(engine, now),
    pacing: settings.pacing,
    tolerance: { ...settings.tolerance },
    gate_enabled: settings.gate === "event",
    media_gate: settings.gate,
    streams: streamsOf(engine, now),
    picture_delay_ms: driver?.latency.pictureMs ?? null,
    picture_delay_p50_ms: driver === null ? null : quantile(driver.latency.toPicture, 0.5),
    picture_delay_p95_ms: driver === null ? null : quantile(driver.latency.toPicture, 0.95),
    round_trip_ms: state.roundTripMs,
    command_to_feedback_ms: {
      median: driver === null ? null : quantile(driver.latency.toFeedback, 0.5),
      p99: driver === null ? null : quantile(driver.latency.toFeedback, 0.99),
    },
    command_to_picture_ms: {
      median: driver === null ? null : quantile(driver.latency.toPicture, 0.5),
      p95: driver === null ? null : quantile(driver.latency.toPicture, 0.95),
      p99: driver === null ? null : quantile(driver.latency.toPicture, 0.99),
      maximum: driver === null ? null : quantile(driver.latency.toPicture, 1),
    },
    event_rate: rateOf(engine.events, now),
    speed_share: engine.driving.speedShare,
    limits: state.feedback?.limits ?? [],
    stop: { ...state.stop },
    stop_press: engine.stopping.fate(now),
    stale: main === undefined ? null : stalenessOf(engine.streams, main, now),
    at_rest: state.feedback?.at_rest ?? null,
    joints: state.feedback?.joints ?? [],
    axes: axesOf(engine),
    goals: byAxis(engine, state.feedback?.goals ?? [], "goal"),
    commanded: byAxis(engine, engine.driving.values),
    layer: state.robot?.description.layers[engine.driving.layer]?.name ?? null,
    faults: state.feedback?.faults ?? [],
    first_picture_ms: engine.firstPictureMs,
    sound: engine.streams.isAudible() ? "on" : "off",
    pad: padOf(engine),
    headset: engine.headset?.statistics() ?? null,
    bad_messages: state.badMessages,
  };
}

function gateOf(engine: ConsoleEngine, now: number): Statistics["gate"] {
  const block = gateReason(engine.state, engine.hears(now), engine.stopping.outranks(engine.state.stop, now));
  if (block !== null) return { state: block, reason: GATE_REASON_LABELS[block] };
  const state = engine.driving.driver === null ? "no_feedback" : gateState(engine.driving.driver.gate, now);
  return { state, reason: GATE_LABELS[state] };
}

function padOf(engine: ConsoleEngine): Statistics["pad"] {
  const state = engine.controls.pad?.state ?? null;
  return state === null ? null : { id: state.id, ready: state.ready, calibrated: state.setup.calibrated };
}

function axesOf(engine: ConsoleEngine): Statistics["axes"] {
  const { robot, feedback } = engine.state;
  const named = (robot?.description.axes ?? []).map(({ name }, index) => {
    const known = feedback?.unknown.includes(name) === false;
    return [name, known ? (feedback.axes[index] ?? null) : null] as const;
  });
  return Object.fromEntries(named);
}

function byAxis(
  engine: ConsoleEngine,
  values: readonly (number | null)[],
  kind?: "goal",
): Record<string, number | null> {
  const axes = engine.state.robot?.description.axes ?? [];
  return Object.fromEntries(
    axes.flatMap((axis, index) =>
      kind === undefined || axis.kind === kind ? [[axis.name, values[index] ?? null] as const] : [],
    ),
  );
}

function streamsOf(engine: ConsoleEngine, now: number): Record<string, StreamStatistics> {
  const found: Record<string, StreamStatistics> = {};
  for (const [name, video] of engine.streams.videos) {
    const { width, height, frames } = video;
    found[name] = {
      ...common(video.info, video.gate.counts),
      frame_rate: rateOf(frames, now),
      width,
      height,
    };
  }
  for (const [name, sound] of engine.streams.sounds) {
    const counts = common(sound.info, sound.gate.counts);
    found[name] = {
      ...counts,
      received: sound.received(),
      discarded: sound.discarded(),
      frame_rate: null,
      width: 0,
      height: 0,
    };
  }
  return found;
}

function common(
  info: StreamInfo,
  counts: GateCounters,
): Omit<StreamStatistics, "frame_rate" | "width" | "height"> {
  const { stamp, gap, received, rendered, discarded, held, violations } = counts;
  const { kind, carrier, codec } = info;
  const gaps = { gap, max_gap: counts.maxGap, mean_gap: meanGap(counts) };
  return { kind, carrier, codec, stamp, ...gaps, received, rendered, discarded, held, violations };
}
