import type { Pacing } from "../drive/command_gate";
import type { GateMode } from "../gate/media_gate";
import type { FeedbackArrival } from "../media/media_streams";
import type { Rendering } from "../media/render_log";
import type { ConsoleEngine } from "../engine/console_engine";
import type { SceneStatistics, SceneView } from "../scene/scene_view";
import { statisticsOf, type Statistics } from "../engine/statistics";
import type { RobotDescription } from "../protocol/wire";
import type { TracedCommand, TracedPicture } from "../engine/trace_book";

/** What may be set by code; a field that is left out stays as it is. */
export interface Configuration {
  readonly gate?: GateMode;
  readonly pacing?: Pacing;
  readonly tolerance?: { readonly video?: number; readonly audio?: number };
}

/** `window.lockstep`: live figures for tests and operators' own tools (docs/console-api.md). */
export interface LockstepHook {
  stats(): Statistics;
  /** What the robot says about itself; null before it has. */
  robot(): RobotDescription | null;
  /** The newest pictures drawn, or segments heard, of one stream. */
  rendered(stream: string): readonly Rendering[];
  /** The newest events and when their feedback came. */
  feedbacks(): readonly FeedbackArrival[];
  /** The newest traced pictures and commands, while traces are asked for (docs/traces.md). */
  traces(): { readonly pictures: readonly TracedPicture[]; readonly commands: readonly TracedCommand[] };
  /** Asks the console for traces, or no more; the charts ask too while they are open. */
  trace(wanted: boolean): void;
  /** What the 3D scene shows. */
  scene(): SceneStatistics;
  configure(configuration: Configuration): void;
}

declare global {
  interface Window {
    lockstep?: LockstepHook;
  }
}

const NO_SCENE: SceneStatistics = { state: "away", event: null, gap: null, held: 0, forced: 0 };

/** The page that the hook looks at. */
export interface HookedPage {
  readonly engine: ConsoleEngine;
  readonly grid: { readonly scene: SceneView | null; mainStream(): string | null };
}

export function installHook(page: HookedPage): void {
  const { engine } = page;
  const { streams } = engine;
  window.lockstep = {
    stats: () => statisticsOf(engine, page.grid.mainStream()),
    robot: () => engine.state.robot?.description ?? null,
    rendered: (stream) => (streams.videos.get(stream) ?? streams.sounds.get(stream))?.log.all() ?? [],
    feedbacks: () => streams.feedbacks.all(),
    traces: () => ({
      pictures: engine.tracing?.book.pictures.all() ?? [],
      commands: engine.tracing?.book.commands.all() ?? [],
    }),
    trace: (wanted) => engine.tracing?.show(wanted, performance.now()),
    scene: () => page.grid.scene?.statistics() ?? NO_SCENE,
    configure({ gate, pacing, tolerance }) {
      const { settings } = engine.state;
      settings.gate = gate ?? settings.gate;
      settings.pacing = pacing ?? settings.pacing;
      settings.tolerance.video = tolerance?.video ?? settings.tolerance.video;
      settings.tolerance.audio = tolerance?.audio ?? settings.tolerance.audio;
      engine.settingsChanged();
    },
  };
}
