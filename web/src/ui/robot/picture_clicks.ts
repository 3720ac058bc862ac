import { MapGestures, LONG_PRESS_MS, type Gesture } from "../../map/map_gestures";
import type { ConsoleEngine } from "../../engine/console_engine";
import { mayDrive, note } from "../../session/console_state";
import { ACT_REFUSAL_LABELS } from "../../robot/act_refusal_labels";
import { actRefusal } from "../../robot/actions";
import { actConditions } from "../../engine/act_conditions";

/** Where a place on a canvas is in its picture, in shares from the left and the top; null: beside it. */
export function pictureShare(
  canvas: { readonly width: number; readonly height: number; readonly wide: number; readonly high: number },
  left: number,
  [x, y]: readonly [number, number],
): readonly [number, number] | null {
  const { width, height, wide, high } = canvas;
  if (wide === 0 || high === 0 || width === 0 || height === 0) return null;
  const scale = Math.min(wide / width, high / height);
  const across = (x - (wide - width * scale) * left) / (width * scale);
  const down = (y - (high - height * scale) / 2) / (height * scale);
  return across >= 0 && across <= 1 && down >= 0 && down <= 1 ? [across, down] : null;
}

/** A click on the large picture of a camera that says so, or a finger that rests on it, asks for the camera's action. */
export function watchPictureClicks(engine: ConsoleEngine, views: HTMLElement): void {
  const gestures = new MapGestures();
  let canvas: HTMLCanvasElement | null = null;
  const at = (event: PointerEvent): [number, number] => [event.offsetX, event.offsetY];
  const take = (all: readonly Gesture[]): void => {
    for (const each of all) if (each.kind === "goal" && canvas !== null) ask(engine, canvas, each.at);
  };
  views.addEventListener("pointerdown", (event) => {
    const { target } = event;
    if (!(target instanceof HTMLCanvasElement) || clickOf(engine, target) === "") return;
    canvas = target;
    const kind = event.pointerType === "mouse" ? "mouse" : "touch";
    take(gestures.down(event.pointerId, kind, event.button === 0, at(event), performance.now()));
    setTimeout(() => take(gestures.look(performance.now())), LONG_PRESS_MS + 10);
  });
  views.addEventListener("pointermove", (event) => take(gestures.move(event.pointerId, at(event))));
  views.addEventListener("pointerup", (event) => {
    if (event.target === canvas) take(gestures.up(event.pointerId, at(event)));
    else gestures.cancel();
  });
  views.addEventListener("pointercancel", () => gestures.cancel());
  addEventListener("blur", () => gestures.cancel());
}

function clickOf(engine: ConsoleEngine, canvas: HTMLCanvasElement): string {
  const { state } = engine;
  const camera = state.robot?.description.cameras.find((each) => each.name === canvas.dataset["stream"]);
  return mayDrive(state) ? (camera?.click ?? "") : "";
}

/** With the event of the picture that is shown: the robot refuses a picture that is too old. */
function ask(engine: ConsoleEngine, canvas: HTMLCanvasElement, place: readonly [number, number]): void {
  const { state } = engine;
  const action = state.robot?.description.actions.find((each) => each.name === clickOf(engine, canvas));
  const video = engine.streams.videos.get(canvas.dataset["stream"] ?? "");
  const left = parseFloat(getComputedStyle(canvas).objectPosition) / 100;
  const share = pictureShare(
    { width: canvas.width, height: canvas.height, wide: canvas.clientWidth, high: canvas.clientHeight },
    left,
    place,
  );
  if (action === undefined || share === null) return;
  const shown = video?.gate.shown ?? null;
  const refusal = actRefusal(action, state.actions, actConditions(engine, performance.now(), false));
  const why = refusal !== null ? ACT_REFUSAL_LABELS[refusal] : shown === null ? "No picture is shown" : null;
  if (why === null) engine.act(action, { x: share[0], y: share[1], event: shown ?? 0 });
  else note(state, "warning", `${action.label}: ${why}`, Date.now());
}
