import type { ConsoleEngine } from "../../engine/console_engine";
import { note, robotIsUp } from "../../session/console_state";
import { feedbackAge } from "../../drive/feedback_age";
import { sourceLabel } from "../../session/source_labels";
import { CardPlace } from "./card_place";
import { layoutViews, smallShape } from "./view_layout";
import { stalenessOf } from "../../engine/report";
import type { StreamInfo } from "../../protocol/wire";
import { h, setData, setHidden, setText } from "../elements/dom";
import type { SceneSwitch } from "../../scene/scene_switch";
import type { SceneView } from "../../scene/scene_view";

/** What the gate draws for one camera. */
export interface PlacedPicture {
  readonly name: string;
  readonly label: string;
  readonly canvas: HTMLCanvasElement;
}

interface View {
  readonly name: string;
  readonly label: string;
  readonly element: HTMLElement;
  readonly caption: HTMLElement;
  readonly detail: HTMLElement;
  readonly veil: HTMLElement;
  readonly veilWords: HTMLElement;
  readonly swap: HTMLButtonElement;
  readonly canvas: HTMLCanvasElement | null; // null: the scene
}

const SCENE = "3D scene";
const SCENE_SHAPE = 4 / 3;
const TOO_SLOW = "The 3D scene was closed: this machine draws it too slowly";

/** One view large, the others small; a click on a small one swaps it in. */
export class ViewGrid {
  readonly element = h("main", "views", { "aria-label": "Views" });
  readonly gauges = h("div", "gauges");
  readonly cardPlace = new CardPlace();
  scene: SceneView | null = null; // until its code is there
  sceneSwitch: SceneSwitch | null = null; // comes with the scene
  private readonly views = new Map<string, View>(); // cameras in their order, then the scene while it is there
  private sceneView: View | null = null;
  private main: string | null = null;
  private shapes = ""; // of the pictures, as they were last laid out

  constructor() {
    this.element.append(this.gauges);
    const sizes = new ResizeObserver(() => this.fit());
    sizes.observe(this.element);
    sizes.observe(this.gauges);
  }

  takeScene(scene: SceneView, sceneSwitch: SceneSwitch): void {
    this.sceneView = createView(SCENE, SCENE, null, scene.element, () => this.swapIn(SCENE));
    this.scene = scene;
    this.sceneSwitch = sceneSwitch;
  }

  /** The canvas of a stream; the same one again after a reconnect. */
  canvas(info: StreamInfo): HTMLCanvasElement {
    const known = this.views.get(info.stream)?.canvas;
    if (known) return known;
    const canvas = h("canvas", "picture", { "data-stream": info.stream, width: "640", height: "480" });
    this.addView(createView(info.stream, info.label, canvas, canvas, () => this.swapIn(info.stream)));
    if (this.main === null) this.swapIn(info.stream);
    return canvas;
  }

  /** The camera in the large view, or the first one while the scene is large. */
  mainStream(): string | null {
    return this.largeStream() ?? this.pictures()[0]?.name ?? null;
  }

  /** The camera in the large view; null while the scene or the map is there. */
  largeStream(): string | null {
    return this.views.get(this.main ?? "")?.canvas ? this.main : null;
  }

  /** Shows a view of no camera, large, or takes it away. It may be shown again. */
  toggleView(name: string, content: HTMLElement): void {
    if (this.views.has(name)) {
      this.views.get(name)?.element.remove();
      this.views.delete(name);
      if (this.main === name) this.swapIn(this.mainStream() ?? SCENE);
      else this.arrange();
      return;
    }
    this.addView(createView(name, name, null, content, () => this.swapIn(name)));
    this.swapIn(name);
  }

  /** The cameras' pictures as they are on the page, in their order. */
  pictures(): PlacedPicture[] {
    return [...this.views.values()].flatMap(({ name, label, canvas }) =>
      canvas === null ? [] : [{ name, label, canvas }],
    );
  }

  update(engine: ConsoleEngine, now: number): void {
    this.element.classList.toggle("is-locked", engine.driving.isArmed());
    this.scene?.follow(engine.state.robot?.epoch ?? null);
    if (this.scene !== null && this.sceneView !== null)
      this.updateScene(this.scene, this.sceneView, engine, now);
    for (const view of this.views.values()) if (view.canvas !== null) showVeil(engine, view, now);
    if (this.shapes !== shapesOf(this.views)) this.fit();
  }

  private updateScene(scene: SceneView, view: View, engine: ConsoleEngine, now: number): void {
    // Nothing may keep STOP waiting, so a scene that this machine cannot draw fast enough goes.
    if (scene.hasSettled(now) && engine.ticker.isHeldUp(now)) {
      if (scene.full.isOpen) scene.full.close();
      else this.sceneSwitch?.giveUp();
      const camera = this.mainStream();
      if (camera !== null && this.main === SCENE) this.swapIn(camera);
      note(engine.state, "warning", TOO_SLOW, Date.now());
    }
    if (scene.hasFailed && this.sceneSwitch?.isWanted === false) this.sceneSwitch.giveUp();
    this.sceneSwitch?.update(engine, now);
    this.showScene(scene, view, engine);
    scene.take(engine.state.feedback);
    scene.update();
    if (this.views.has(SCENE)) showSceneVeil(scene, view, engine, this.isLarge(view), now);
  }

  /** The scene stands on the page or it does not: nothing is kept free for one that is not there. */
  private showScene(scene: SceneView, view: View, engine: ConsoleEngine): void {
    const isOn = this.sceneSwitch?.isOn === true;
    const description = engine.state.robot?.description;
    if (isOn && description !== undefined) scene.open(description);
    if (isOn === this.views.has(SCENE)) return;
    if (isOn) {
      this.addView(view);
      return;
    }
    scene.close();
    this.views.delete(SCENE);
    view.element.remove();
    if (this.main === SCENE) this.main = this.mainStream();
    this.arrange();
  }

  private addView(view: View): void {
    const hasScene = this.views.delete(SCENE);
    this.views.set(view.name, view);
    if (hasScene && this.sceneView !== null) this.views.set(SCENE, this.sceneView);
    this.element.append(view.element);
    this.arrange();
  }

  private swapIn(name: string): void {
    this.main = name;
    if (name === SCENE) this.scene?.full.open();
    else this.scene?.full.close();
    this.arrange();
  }

  /** Whether it has the large place: where there is no camera, the scene has. */
  private isLarge(view: View): boolean {
    return view.name === (this.main ?? SCENE);
  }

  private arrange(): void {
    let place = 0;
    for (const view of this.views.values()) {
      const isLarge = this.isLarge(view);
      setData(view.element, "place", isLarge ? "main" : "small");
      view.element.style.order = String(isLarge ? 0 : place + 1);
      view.element.style.setProperty("--slot", String(place));
      if (!isLarge) place += 1;
      setHidden(view.swap, isLarge);
    }
    this.element.style.setProperty("--small", String(Math.max(1, place)));
    this.fit();
  }

  /** Gives the others the room that the large picture leaves. */
  private fit(): void {
    this.shapes = shapesOf(this.views);
    const style = getComputedStyle(this.element);
    const gap = parseFloat(style.columnGap);
    let large = SCENE_SHAPE;
    const small: number[] = [];
    for (const view of this.views.values()) {
      const shape = shapeOf(view);
      view.element.style.setProperty("--shape", String(smallShape(shape)));
      if (this.isLarge(view)) large = shape;
      else small.push(shape);
    }
    const gauges = [...this.gauges.children]
      .map((gauge) => gauge.clientHeight)
      .filter((height) => height > 0);
    const { cardPlace } = this;
    const card = cardPlace.measure();
    const beside = cardPlace.isBeside ? (card?.height ?? 0) : 0; // the room has its height already
    const plan = layoutViews({
      width: this.element.clientWidth - 2 * parseFloat(style.paddingLeft),
      height: this.element.clientHeight - 2 * parseFloat(style.paddingTop) - beside,
      gap,
      large,
      small,
      gauges,
      card,
    });
    this.element.style.setProperty("--columns", rowColumns(small.length, gauges.length > 0));
    setData(this.element, "run", plan.run);
    setData(this.element, "tight", String(plan.tight));
    this.element.style.setProperty("--size", `${plan.size}px`);
    cardPlace.lay(plan.card, plan.size, plan.run === "row" ? rowWidth(small, plan.size, gap) : 0);
  }
}

function createView(
  name: string,
  label: string,
  canvas: HTMLCanvasElement | null,
  content: HTMLElement,
  enlarge: () => void,
): View {
  const caption = h("span", "view-label", {}, label);
  const detail = h("span", "view-detail");
  const veilWords = h("strong", "veil-words");
  const about = h("span", "veil-about", {}, "This picture does not show the robot's present state");
  const veil = h("div", "veil", {}, h("div", "veil-plate", {}, veilWords, about));
  const swap = h("button", "view-swap", { type: "button", "aria-label": `Show ${label} large` });
  swap.addEventListener("click", enlarge);
  const bar = h("figcaption", "view-caption", {}, caption, detail);
  const element = h("figure", "view", { "data-view": name }, content, veil, bar, swap);
  setHidden(veil, true);
  return { name, label, element, caption, detail, veil, veilWords, swap, canvas };
}

/** Of a row: the last one takes the rest. A column of their own for gauges that are not there would leave a gap. */
function rowColumns(small: number, hasGauges: boolean): string {
  const before = hasGauges ? small : small - 1;
  return before > 0 ? `repeat(${before}, auto) minmax(0, 1fr)` : "minmax(0, 1fr)";
}

/** Of small views of these shapes, with a gap behind each. */
function rowWidth(small: readonly number[], height: number, gap: number): number {
  return small.reduce((width, shape) => width + smallShape(shape) * height + gap, 0);
}

function shapeOf({ canvas }: View): number {
  return canvas === null || canvas.height === 0 ? SCENE_SHAPE : canvas.width / canvas.height;
}

function shapesOf(views: ReadonlyMap<string, View>): string {
  return [...views.values()].map((view) => shapeOf(view).toFixed(3)).join(" ");
}

/** The scene is judged like a picture: by how far its event is from the feedback. */
function showSceneVeil(
  scene: SceneView,
  view: View,
  engine: ConsoleEngine,
  isLarge: boolean,
  now: number,
): void {
  const { event, gap } = scene.statistics();
  const staleness = scene.staleness(feedbackAge(engine.measuredMs, now));
  const words = event === null && staleness === null ? null : (unreachableWords(engine) ?? staleness);
  setHidden(view.veil, words === null);
  view.element.classList.toggle("is-stale", words !== null);
  if (words !== null) setText(view.veilWords, words);
  const { video } = engine.state.settings.tolerance;
  const unknown = scene.lacksJoints ? " · not all joints measured" : "";
  setText(view.detail, event === null || gap === null ? "" : `s ${event} · gap ${gap} of ${video}${unknown}`);
  setData(view.element, "gap", words === null ? "good" : "bad");
  setHidden(view.swap, isLarge && scene.full.isOpen);
}

function showVeil(engine: ConsoleEngine, view: View, now: number): void {
  const words = veilWords(engine, view.name, now);
  setHidden(view.veil, words === null);
  view.element.classList.toggle("is-stale", words !== null);
  if (words !== null) setText(view.veilWords, words);
  const gap = knownGap(engine, view.name, now);
  const tolerance = engine.state.settings.tolerance.video;
  setText(view.detail, gap === null ? "" : `gap ${gap} of ${tolerance}`);
  setData(view.element, "gap", gap !== null && Math.abs(gap) > tolerance ? "bad" : "good");
}

/** Events between the picture of a camera and the robot; null when one of them is not known. */
export function knownGap(engine: ConsoleEngine, name: string, now: number): number | null {
  if (!engine.hears(now) || !robotIsUp(engine.state)) return null; // the robot may have executed more
  return engine.streams.videos.get(name)?.gapOnScreen() ?? null;
}

/** Why the picture of a camera does not show the robot's present state; null when it may be looked at. */
export function veilWords(engine: ConsoleEngine, name: string, now: number): string | null {
  const video = engine.streams.videos.get(name);
  if (video === undefined) return "Not connected";
  const unreachable = unreachableWords(engine);
  if (unreachable !== null) return unreachable;
  const source = engine.state.sources.find((each) => each.stream === name);
  return (source && sourceLabel(source)) ?? stalenessOf(engine.streams, video, now);
}

function unreachableWords(engine: ConsoleEngine): string | null {
  if (engine.state.welcome === null) return "Not connected";
  return engine.state.robot !== null && !robotIsUp(engine.state) ? "Robot unreachable" : null;
}
