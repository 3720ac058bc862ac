import type { Latency } from "../drive/latency";
import type { ConsoleState } from "../session/console_state";
import { addRow, createChartRing, type ChartRing, type StreamPoint } from "./chart_ring";
import { rateOf, type RateMeter } from "../util/samples";
import type { Rendering } from "../media/render_log";
import type { SoundStream } from "../media/sound/sound_stream";
import type { VideoStream } from "../media/video_stream";

const ROW_MS = 100;

/** What the charts show. */
export interface ChartSource {
  readonly state: Pick<ConsoleState, "feedback" | "robot" | "roundTripMs" | "settings">;
  readonly driving: { readonly driver: { readonly latency: Latency } | null };
  readonly events: RateMeter;
  readonly streams: {
    readonly videos: ReadonlyMap<string, VideoStream>;
    readonly sounds: ReadonlyMap<string, SoundStream>;
  };
  hears(now: number): boolean; // the console has spoken lately
}

/** Writes ten rows a second of the page's state, whether or not anybody looks at them. */
export class ChartSampler {
  readonly ring: ChartRing = createChartRing();
  private rowMs = -Infinity;

  constructor(private readonly source: ChartSource) {}

  step(now: number): void {
    if (now - this.rowMs < ROW_MS) return;
    const since = this.rowMs;
    // Evenly, unless the page was held up.
    this.rowMs = now - this.rowMs < 2 * ROW_MS ? this.rowMs + ROW_MS : now;
    this.addRow(since, now);
  }

  private addRow(since: number, now: number): void {
    const { source } = this;
    const { state } = source;
    const { driver } = source.driving;
    const hears = source.hears(now);
    const latency = driver?.latency;
    addRow(this.ring, {
      wallMs: performance.timeOrigin + now,
      epoch: state.robot?.epoch ?? "",
      event: hears ? (state.feedback?.event ?? null) : null,
      eventRate: hears ? rateOf(source.events, now) : null,
      pictureDelayMs: latency !== undefined && latency.pictureAtMs > since ? latency.pictureMs : null,
      roundTripMs: hears ? state.roundTripMs : null,
      streams: [...source.streams.videos.values(), ...source.streams.sounds.values()].map((stream) =>
        this.point(stream, since),
      ),
    });
  }

  private point(stream: VideoStream | SoundStream, since: number): StreamPoint {
    const { stream: name, label, kind } = stream.info;
    const rendered = stream.log.newest((rendering) => rendering.at > since);
    return {
      name,
      label,
      kind,
      stamp: rendered[0]?.stamp ?? null,
      gap: worstGap(rendered),
      tolerance: this.source.state.settings.tolerance[kind],
    };
  }
}

function worstGap(rendered: readonly Rendering[]): number | null {
  let worst: number | null = null;
  for (const { gap } of rendered)
    if (gap !== null && (worst === null || Math.abs(gap) > Math.abs(worst))) worst = gap;
  return worst;
}
