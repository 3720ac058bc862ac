import type { ArmState } from "../drive/arming";
import type { MediaStreams } from "../media/media_streams";
import type { ConsoleState } from "../session/console_state";
import type { GateMode } from "../gate/media_gate";
import { takeLag } from "../gate/gate_counters";
import { staleness } from "../gate/staleness";
import type { VideoStream } from "../media/video_stream";
import type { SoundStream } from "../media/sound/sound_stream";
import type { Report, StreamReport } from "../protocol/wire";

/** What a report is made of. */
export interface ReportSource {
  readonly state: Pick<ConsoleState, "feedback" | "roundTripMs" | "settings">;
  readonly streams: {
    readonly videos: ReadonlyMap<string, VideoStream>;
    readonly sounds: ReadonlyMap<string, SoundStream>;
  };
  readonly driving: {
    readonly arming: { readonly state: ArmState };
    readonly viewDelayMs: number | null; // how late the pictures are now
  };
}

/** Why a view must not be trusted; null when it may. */
export function stalenessOf(
  streams: Pick<MediaStreams, "context">,
  video: VideoStream,
  now: number,
): string | null {
  return staleness(video.gate.shown, video.lastDrawnMs, video.lastGoodMs, streams.context("video"), now);
}

/** What the console is told twice a second. */
export function reportOf(source: ReportSource): Report {
  const { settings } = source.state;
  return {
    type: "report",
    event: source.state.feedback?.event ?? 0,
    armed: source.driving.arming.state !== "disarmed",
    streams: [
      ...[...source.streams.videos.values()].map((stream) =>
        streamReport(stream, settings.tolerance.video, settings.gate),
      ),
      ...[...source.streams.sounds.values()].map((stream) =>
        streamReport(stream, settings.tolerance.audio, settings.gate),
      ),
    ],
    picture_delay_ms: source.driving.viewDelayMs,
    round_trip_ms: source.state.roundTripMs,
    speed_cap: settings.speedCap,
  };
}

function streamReport(stream: VideoStream | SoundStream, tolerance: number, gate: GateMode): StreamReport {
  const { counts } = stream.gate;
  return {
    stream: stream.info.stream,
    carrier: stream.info.carrier,
    stamp: counts.stamp ?? 0,
    gap: counts.gap ?? 0,
    max_gap: counts.maxGap,
    rendered: counts.rendered,
    discarded: "discarded" in stream ? stream.discarded() : counts.discarded,
    held: counts.held,
    tolerance,
    lag: takeLag(counts),
    violations: counts.violations,
    gate,
  };
}
