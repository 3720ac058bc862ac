import type { ConsoleApp } from "../console_app";
import { sceneDue } from "../core/scene_gate";
import type { ConsoleApi } from "../rtc/console_api";
import { SceneView } from "./scene_view";
import type { ViewBoard } from "./view_board";

/** The 3D scene of a page: it shows the event of the picture in the large view. */
export function createScene(app: ConsoleApp, board: ViewBoard, api: ConsoleApi): SceneView {
  return new SceneView(api, {
    due: () => {
      const video = app.room.videos.get(board.mainStream() ?? "");
      return sceneDue(app.room.context("video"), video?.gate.shown ?? null);
    },
    context: () => app.room.context("video"),
    onkey: (key) => app.controls.keyboard.foreign(key),
  });
}
