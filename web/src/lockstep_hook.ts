import type { Pacing } from "./core/command_gate";
import type { GateMode } from "./core/media_gate";
import type { FeedbackArrival } from "./media_room";
import type { Rendering } from "./media/render_log";
import type { Page } from "./page";
import type { SceneStatistics } from "./ui/scene_view";
import { statisticsOf, type Statistics } from "./statistics";
import type { RobotDescription } from "./wire";

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

export function installHook(page: Page): void {
  const { app } = page;
  const { room } = app;
  window.lockstep = {
    stats: () => statisticsOf(app, page.board.mainStream()),
    robot: () => app.state.robot?.description ?? null,
    rendered: (stream) => (room.videos.get(stream) ?? room.sounds.get(stream))?.log.all() ?? [],
    feedbacks: () => room.feedbacks.all(),
    scene: () => page.board.scene?.statistics() ?? NO_SCENE,
    configure({ gate, pacing, tolerance }) {
      const { settings } = app.state;
      settings.gate = gate ?? settings.gate;
      settings.pacing = pacing ?? settings.pacing;
      settings.tolerance.video = tolerance?.video ?? settings.tolerance.video;
      settings.tolerance.audio = tolerance?.audio ?? settings.tolerance.audio;
      app.settingsChanged();
    },
  };
}
