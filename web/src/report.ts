import type { GateMode } from "./core/media_gate";
import { takeLag } from "./core/medium_counts";
import { staleness } from "./core/staleness";
import type { ConsoleApp } from "./console_app";
import type { VideoStream } from "./media/video_stream";
import type { SoundStream } from "./media/sound_stream";
import type { Report, StreamReport } from "./wire";

/** Why a view must not be trusted; null when it may. */
export function stalenessOf(app: ConsoleApp, video: VideoStream, now: number): string | null {
  return staleness(video.gate.shown, video.lastDrawnMs, video.lastGoodMs, app.room.context("video"), now);
}

/** What the console is told twice a second. */
export function reportOf(app: ConsoleApp): Report {
  const { settings } = app.state;
  return {
    type: "report",
    event: app.state.feedback?.event ?? 0,
    armed: app.arming.state !== "disarmed",
    streams: [
      ...[...app.room.videos.values()].map((stream) =>
        streamReport(stream, settings.tolerance.video, settings.gate),
      ),
      ...[...app.room.sounds.values()].map((stream) =>
        streamReport(stream, settings.tolerance.audio, settings.gate),
      ),
    ],
    picture_delay_ms: app.viewDelayMs,
    round_trip_ms: app.state.roundTripMs,
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
