import "../style/console/map.css";
import { feedbackAge } from "../drive/feedback_age";
import type { ConsoleEngine } from "../engine/console_engine";
import type { Navigation, RobotDescription } from "../protocol/wire";
import { ACT_REFUSAL_LABELS } from "../robot/act_refusal_labels";
import { actRefusal, newestOf } from "../robot/actions";
import { actionTone, actionWords } from "../robot/action_labels";
import { holdsSeat, mayDrive, note } from "../session/console_state";
import type { ConsoleApi } from "../transport/signalling/console_api";
import { button, h, setData, setHidden, setText } from "../ui/elements/dom";
import { MapDrawing } from "./map_drawing";
import {
  fitted,
  gridExtent,
  panned,
  toMap,
  zoomed,
  type PlanarPose,
  type Point,
  type Size,
  type Viewport,
} from "./map_geometry";
import { MapGestures, type Gesture } from "./map_gestures";
import { MapLoader } from "./map_loader";
import {
  SILENT_MS,
  ageWords,
  beyondBounds,
  goalAction,
  goalParameters,
  headingOf,
  pathPoints,
  placeOf,
  runningGoal,
  scanOf,
  type Place,
} from "./map_state";
import { actConditions } from "../engine/act_conditions";

const STEP = 1.4; // of a press on a zoom button
const WHEEL = 0.0015; // per pixel of a wheel
const SHOWN_MS = 8000; // how long the end of a goal stays in words
const AROUND = 5; // m, what is seen around the robot without a map

/** The map: where the robot is on it, where it is going, and by a hand on it where it is to go. */
export class MapView {
  readonly element = h("div", "map");
  private readonly canvas = h("canvas", "map-canvas", {
    role: "img",
    "aria-label": "Map. Goals can be given as numbers with the robot's action too.",
  });
  private readonly words = h("p", "map-words", { role: "status" });
  private readonly facts = h("p", "map-facts");
  private readonly veil = h("p", "map-veil");
  private readonly cancel = button("map-tool map-cancel", "Cancel", () => this.cancelGoal());
  private readonly drawing = new MapDrawing();
  private readonly loader: MapLoader;
  private readonly gestures = new MapGestures();
  private view: Viewport | null = null; // null: as much as there is
  private aim: { readonly at: Point; readonly towards: Point | null } | null = null; // m
  private place: Place = { kind: "unknown", why: "" };
  private navigation: Navigation | null = null;
  private fittedTo = ""; // the map and size that the view was fitted to
  private epoch = "";

  constructor(
    private readonly engine: ConsoleEngine,
    api: ConsoleApi,
  ) {
    this.loader = new MapLoader(api);
    const tools = h(
      "div",
      "map-tools",
      { role: "group", "aria-label": "View of the map" },
      tool("+", "Nearer", () => this.zoom(STEP)),
      tool("−", "Farther", () => this.zoom(1 / STEP)),
      tool("⤢", "Whole map", () => (this.view = null)),
    );
    const hint = h(
      "p",
      "map-hint",
      {},
      h("span", "for-mouse", {}, MOUSE_HINT),
      h("span", "for-touch", {}, TOUCH_HINT),
    );
    this.element.append(
      this.canvas,
      this.veil,
      tools,
      this.cancel,
      h("div", "map-notes", {}, this.words, this.facts, hint),
    );
    this.listen();
  }

  update(now: number): void {
    const { engine } = this;
    const description = engine.state.robot?.description ?? null;
    this.followEpoch(engine.state.robot?.epoch ?? "");
    this.take(this.gestures.look(now));
    const navigation = engine.late.newest.get("navigation")?.message;
    this.navigation = navigation?.type === "navigation" ? navigation : null;
    if (description === null || description.map === null) {
      this.showVeil("Not connected");
      return;
    }
    const sinceMs = now - (engine.late.newest.get("navigation")?.atMs ?? -Infinity);
    const isSilent = sinceMs > SILENT_MS || feedbackAge(engine.measuredMs, now) !== null;
    this.place = placeOf(description, engine.state.feedback, this.navigation, isSilent);
    const map = this.loader.map(this.navigation?.map ?? "", now);
    this.draw(description, map);
    this.showWords(description, now);
    const mapWords =
      map !== null
        ? `Map ${ageWords((this.navigation?.map_age ?? 0) + sinceMs / 1000)}`
        : this.navigation?.map === ""
          ? "No map yet"
          : "Loading the map…";
    setText(this.facts, this.place.kind === "known" ? `${mapWords} · s ${this.place.event}` : mapWords);
    this.showVeil(
      isSilent
        ? "Nothing new is heard of the robot's place"
        : this.place.kind === "unknown"
          ? this.place.why
          : "",
    );
  }

  /** Nothing that was begun by hand goes on, as when the map is taken away. */
  cancelGesture(): void {
    this.take(this.gestures.cancel());
  }

  private followEpoch(epoch: string): void {
    if (epoch === this.epoch) return;
    this.epoch = epoch;
    this.view = null;
    this.cancelGesture();
  }

  private showVeil(words: string): void {
    setText(this.veil, words);
    setHidden(this.veil, words === "");
    this.element.classList.toggle("is-stale", words !== "");
  }

  private draw(description: RobotDescription, map: ReturnType<MapLoader["map"]>): void {
    const size = this.resize();
    const context = this.canvas.getContext("2d");
    if (context === null || size.width === 0 || size.height === 0) return;
    const robot = this.place.kind === "known" ? this.place.pose : null;
    const key = `${map?.id ?? ""} ${size.width} ${size.height}`;
    if (this.view === null || (this.fittedTo !== key && this.fittedTo !== "moved")) {
      const around = robot ?? [0, 0, 0];
      const extent =
        map === null
          ? {
              left: around[0] - AROUND,
              right: around[0] + AROUND,
              low: around[1] - AROUND,
              high: around[1] + AROUND,
            }
          : gridExtent(map.origin, map.width * map.resolution, map.height * map.resolution);
      this.view = fitted(extent, size, ...coveredOf(size));
      this.fittedTo = key;
    }
    const { navigation, aim } = this;
    const ratio = this.canvas.width / size.width;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const goal = navigation?.goal ?? [];
    const [x, y, yaw] = goal;
    const aimed = aim === null ? null : { at: aim.at, yaw: headingOf(aim.at, aim.towards, robot) };
    this.drawing.draw(context, size, this.view, {
      map,
      zones: description.geofences,
      zoneFrame: navigation?.frame ?? [0, 0, 0],
      robot,
      radius: description.map?.radius ?? 0,
      scan: scanOf(description, this.engine.state.feedback),
      path: pathPoints(navigation?.path ?? []),
      goal:
        x === undefined || y === undefined || yaw === undefined ? null : ([x, y, yaw] satisfies PlanarPose),
      aim: aimed,
    });
  }

  /** Keeps the canvas as sharp as the screen. */
  private resize(): Size {
    const { canvas } = this;
    const size = { width: canvas.clientWidth, height: canvas.clientHeight };
    const ratio = Math.min(2, devicePixelRatio);
    const [width, height] = [Math.round(size.width * ratio), Math.round(size.height * ratio)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    return size;
  }

  private showWords(description: RobotDescription, now: number): void {
    const { engine } = this;
    const { state } = engine;
    const action = goalAction(description);
    const update = action === null ? null : newestOf(state.actions, action.name);
    const running = runningGoal(state.actions, action);
    const isShown =
      update !== null &&
      (running !== null || (state.actions.at(-1) === update && now - engine.actionMs < SHOWN_MS));
    setText(
      this.words,
      action !== null && isShown ? actionWords(action, update) : whyNoGoal(engine, description, now),
    );
    setData(this.words, "says", isShown ? "action" : "hint");
    setData(this.words, "tone", isShown ? actionTone(update) : "off");
    setHidden(this.cancel, running === null || !(holdsSeat(state) || state.welcome?.role === "supervisor"));
    setData(this.element, "aims", String(this.aim !== null));
    setData(this.element, "goals", String(action !== null && mayDrive(state)));
  }

  private cancelGoal(): void {
    const description = this.engine.state.robot?.description;
    const running = description && runningGoal(this.engine.state.actions, goalAction(description));
    if (running) this.engine.actions?.cancel(running.id);
  }

  private setGoal(at: Point, towards: Point | null): void {
    const { engine } = this;
    const description = engine.state.robot?.description;
    const action = description ? goalAction(description) : null;
    if (action === null || !mayDrive(engine.state)) return;
    const refusal = actRefusal(action, engine.state.actions, actConditions(engine, performance.now(), false));
    const robot = this.place.kind === "known" ? this.place.pose : null;
    const parameters = goalParameters(action, at, towards, robot);
    const why =
      refusal !== null
        ? ACT_REFUSAL_LABELS[refusal]
        : this.place.kind === "unknown"
          ? this.place.why
          : beyondBounds(action, parameters);
    if (why === null) engine.act(action, parameters);
    else note(engine.state, "warning", `${action.label}: ${why}`, Date.now());
  }

  private zoom(factor: number): void {
    const size = this.resize();
    this.change((view) => zoomed(view, size, [size.width / 2, size.height / 2], factor));
  }

  private change(how: (view: Viewport) => Viewport): void {
    if (this.view === null) return;
    this.view = how(this.view);
    this.fittedTo = "moved";
  }

  private take(gestures: readonly Gesture[]): void {
    const size = { width: this.canvas.clientWidth, height: this.canvas.clientHeight };
    for (const gesture of gestures) {
      if (gesture.kind === "pan") this.change((view) => panned(view, gesture.dx, gesture.dy));
      else if (gesture.kind === "zoom") this.change((view) => zoomed(view, size, gesture.at, gesture.factor));
      else if (gesture.kind === "none") this.aim = null;
      else if (this.view !== null) {
        const at = toMap(this.view, size, gesture.at);
        const towards = gesture.towards === null ? null : toMap(this.view, size, gesture.towards);
        if (gesture.kind === "goal") this.setGoal(at, towards);
        else this.aim = { at, towards };
      }
    }
  }

  private listen(): void {
    const { canvas, gestures } = this;
    const at = (event: PointerEvent | WheelEvent): Point => [event.offsetX, event.offsetY];
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      const kind = event.pointerType === "mouse" ? "mouse" : "touch";
      const sets = event.button === 0 && this.element.dataset["goals"] === "true";
      this.take(gestures.down(event.pointerId, kind, sets, at(event), performance.now()));
    });
    canvas.addEventListener("pointermove", (event) => this.take(gestures.move(event.pointerId, at(event))));
    canvas.addEventListener("pointerup", (event) => this.take(gestures.up(event.pointerId, at(event))));
    canvas.addEventListener("pointercancel", () => this.cancelGesture());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const size = { width: canvas.clientWidth, height: canvas.clientHeight };
        this.change((view) => zoomed(view, size, at(event), Math.exp(-event.deltaY * WHEEL)));
      },
      { passive: false },
    );
    addEventListener("blur", () => this.cancelGesture());
  }
}

const MOUSE_HINT = "Click: go there · drag: heading · right button: move the map · wheel: zoom";
const TOUCH_HINT = "Hold: go there, then drag for the heading · two fingers: zoom";

function tool(sign: string, label: string, onclick: () => void): HTMLButtonElement {
  const made = button("map-tool", sign, onclick);
  made.setAttribute("aria-label", label);
  made.title = label;
  return made;
}

/** Why no goal can be set now; "" where one can, or for whoever only watches. */
function whyNoGoal(engine: ConsoleEngine, description: RobotDescription, now: number): string {
  const action = goalAction(description);
  if (action === null || !mayDrive(engine.state)) return "";
  const refusal = actRefusal(action, engine.state.actions, actConditions(engine, now, false));
  return refusal === null ? "" : `${action.label}: ${ACT_REFUSAL_LABELS[refusal]}`;
}

/** Pixels at the upper and the lower edge that words cover, on a phone the robot's actions too. */
function coveredOf({ width, height }: Size): [number, number] {
  if (height < 200) return [0, 0];
  return width < 600 ? [104, 44] : [0, 64];
}
