import type { Rendering } from "./media/render_log";
import type { Page } from "./page";
import { statisticsOf, type Statistics } from "./statistics";

/** `window.lockstep`: live figures for tests and operators' own tools (docs/console-api.md). */
export interface LockstepHook {
  stats(): Statistics;
  /** The newest pictures drawn of one stream. */
  rendered(stream: string): readonly Rendering[];
}

declare global {
  interface Window {
    lockstep?: LockstepHook;
  }
}

export function installHook(page: Page): void {
  window.lockstep = {
    stats: () => statisticsOf(page.app, page.board.mainStream()),
    rendered: (stream) => page.app.room.videos.get(stream)?.log.all() ?? [],
  };
}
