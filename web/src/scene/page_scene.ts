import type { ConsoleEngine } from "../engine/console_engine";
import { sceneDue } from "../gate/scene_gate";
import type { ConsoleApi } from "../transport/signalling/console_api";
import { SceneView } from "./scene_view";
import type { ViewGrid } from "../ui/views/view_grid";

/** The 3D scene of a page: it shows the event of the picture in the large view. */
export function createScene(engine: ConsoleEngine, grid: ViewGrid, api: ConsoleApi): SceneView {
  return new SceneView(api, {
    due: () => {
      const video = engine.streams.videos.get(grid.mainStream() ?? "");
      return sceneDue(engine.streams.context("video"), video?.gate.shown ?? null);
    },
    display: engine.display,
    context: () => engine.streams.context("video"),
    onkey: (key) => engine.controls.keyboard.foreign(key),
  });
}
