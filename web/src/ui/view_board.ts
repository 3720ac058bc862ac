import type { ConsoleApp } from "../console_app";
import { robotIsUp } from "../core/console_state";
import { sourceWords } from "../core/source_words";
import { stalenessOf } from "../statistics";
import type { StreamInfo } from "../wire";
import { h, setData, setHidden, setText } from "./dom";
import type { SceneView } from "./scene_view";

interface View {
  readonly name: string;
  readonly element: HTMLElement;
  readonly caption: HTMLElement;
  readonly detail: HTMLElement;
  readonly veil: HTMLElement;
  readonly veilWords: HTMLElement;
  readonly swap: HTMLButtonElement;
  readonly canvas: HTMLCanvasElement | null; // null: the scene
}

const SCENE = "3D scene";

/** One view large, the others small; a click on a small one swaps it in. */
export class ViewBoard {
  readonly element = h("main", "views", { "aria-label": "Views" });
  private readonly views = new Map<string, View>();
  private main: string | null = null;
  private epoch: string | null = null;

  constructor(readonly scene: SceneView) {
    this.addView(SCENE, "3D scene", null, scene.element);
  }

  /** The canvas of a stream; the same one again after a reconnect. */
  canvas(info: StreamInfo): HTMLCanvasElement {
    const known = this.views.get(info.stream)?.canvas;
    if (known) return known;
    const canvas = h("canvas", "picture", { "data-stream": info.stream, width: "640", height: "480" });
    this.addView(info.stream, info.label, canvas, canvas);
    if (this.main === null) this.swapIn(info.stream);
    return canvas;
  }

  /** The camera in the large view, or the first one while the scene is large. */
  mainStream(): string | null {
    if (this.main !== null && this.main !== SCENE) return this.main;
    return [...this.views.keys()].find((name) => name !== SCENE) ?? null;
  }

  /** The camera in the large view; null while the scene is there. */
  largeStream(): string | null {
    return this.main === SCENE ? null : this.main;
  }

  update(app: ConsoleApp, now: number): void {
    this.element.classList.toggle("is-locked", app.isArmed());
    this.followEpoch(app.state.robot?.epoch ?? null);
    if (this.scene.hasSettled(now) && app.ticker.isHeldUp(now)) this.dropScene();
    const { robot } = app.state;
    if (robot !== null) this.scene.setPossible(robot.description.bodies.length > 0);
    this.scene.settle();
    for (const view of this.views.values())
      if (view.canvas !== null) showVeil(app, view, now);
      else this.showSceneVeil(app, view);
  }

  /** The scene is judged like a picture: by how far its event is from the feedback. */
  private showSceneVeil(app: ConsoleApp, view: View): void {
    const { state, event, gap } = this.scene.statistics();
    const words = state === "on" ? (unreachableWords(app) ?? this.scene.staleness()) : null;
    setHidden(view.veil, words === null);
    view.element.classList.toggle("is-stale", words !== null);
    if (words !== null) setText(view.veilWords, words);
    const { video } = app.state.settings.tolerance;
    setText(view.detail, event === null || gap === null ? "" : `s ${event} · gap ${gap} of ${video}`);
    setData(view.element, "gap", words === null ? "good" : "bad");
  }

  /** Nothing may keep STOP waiting, so a scene that this machine cannot draw fast enough goes. */
  private dropScene(): void {
    const camera = [...this.views.keys()].find((name) => name !== SCENE);
    this.scene.unload("Closed: this machine draws it too slowly");
    if (camera !== undefined) this.swapIn(camera);
  }

  /** The scene lives as long as the bridge whose robot it shows. */
  private followEpoch(epoch: string | null): void {
    if (epoch === null || epoch === this.epoch) return;
    if (this.epoch !== null) this.scene.reload();
    this.epoch = epoch;
  }

  private addView(name: string, label: string, canvas: HTMLCanvasElement | null, content: HTMLElement): void {
    const caption = h("span", "view-label", {}, label);
    const detail = h("span", "view-detail");
    const veilWords = h("strong", "veil-words");
    const about = h("span", "veil-about", {}, "This picture does not show the robot's present state");
    const veil = h("div", "veil", {}, h("div", "veil-plate", {}, veilWords, about));
    const swap = h("button", "view-swap", { type: "button", "aria-label": `Show ${label} large` });
    swap.addEventListener("click", () => this.swapIn(name));
    const bar = h("figcaption", "view-caption", {}, caption, detail);
    const element = h("figure", "view", { "data-view": name }, content, veil, bar, swap);
    setHidden(veil, true);
    this.views.set(name, { name, element, caption, detail, veil, veilWords, swap, canvas });
    this.element.append(element);
    this.arrange();
  }

  private swapIn(name: string): void {
    this.main = name;
    if (name === SCENE) this.scene.load();
    else this.scene.unload();
    this.arrange();
  }

  private arrange(): void {
    let place = 1;
    for (const view of this.views.values()) {
      const isMain = view.name === this.main;
      setData(view.element, "place", isMain ? "main" : "small");
      view.element.style.order = String(isMain ? 0 : view.name === SCENE ? 99 : place);
      view.element.style.setProperty(
        "--slot",
        String(isMain ? 0 : view.name === SCENE ? this.views.size - 2 : place - 1),
      );
      if (!isMain && view.name !== SCENE) place += 1;
      setHidden(view.swap, isMain);
    }
    this.element.style.setProperty("--small", String(Math.max(1, this.views.size - 1)));
  }
}

function showVeil(app: ConsoleApp, view: View, now: number): void {
  const video = app.room.videos.get(view.name);
  const words = veilWords(app, view, now);
  setHidden(view.veil, words === null);
  view.element.classList.toggle("is-stale", words !== null);
  if (words !== null) setText(view.veilWords, words);
  const gap = video?.gate.counts.gap ?? null;
  const tolerance = app.state.settings.tolerance.video;
  setText(view.detail, gap === null ? "" : `gap ${gap} of ${tolerance}`);
  setData(view.element, "gap", gap !== null && Math.abs(gap) > tolerance ? "bad" : "good");
}

function veilWords(app: ConsoleApp, view: View, now: number): string | null {
  const video = app.room.videos.get(view.name);
  if (video === undefined) return "Not connected";
  const unreachable = unreachableWords(app);
  if (unreachable !== null) return unreachable;
  const source = app.state.sources.find((each) => each.stream === view.name);
  return (source && sourceWords(source)) ?? stalenessOf(app, video, now);
}

function unreachableWords(app: ConsoleApp): string | null {
  if (app.state.welcome === null) return "Not connected";
  return app.state.robot !== null && !robotIsUp(app.state) ? "Robot unreachable" : null;
}
