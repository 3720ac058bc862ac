import { sceneStaleness } from "../gate/scene_gate";
import { eventGap } from "../gate/serial";
import type { GateContext } from "../gate/gate_counters";
import type { ConsoleApi } from "../transport/signalling/console_api";
import type { Feedback, RobotDescription } from "../protocol/wire";
import type { Display } from "../input/display";
import { h, setData, setText } from "../ui/elements/dom";
import { FullScene } from "./full_scene";
import { SceneDrawing } from "./scene_drawing";
import type { SceneFrameEvents } from "./scene_frame";

/** What is to be seen. `full`: viser's, in its frame. `drawn`: the page's own. */
type SceneState = "away" | "loading" | "drawn" | "full" | "failed";

/** What the page knows that the scene has to keep to. */
export interface SceneSurroundings extends SceneFrameEvents {
  context(): GateContext;
  /** Whose frames it draws in. */
  readonly display: Display;
}

/** `window.lockstep.scene()` */
export interface SceneStatistics {
  readonly state: SceneState;
  readonly event: number | null; // shown
  readonly gap: number | null; // feedback's event minus the shown one
  readonly held: number; // updates of the full scene that wait for their event
  readonly forced: number; // updates that could not wait
}

const FAILED = "This browser cannot draw the 3D scene";
const SETTLE_MS = 5000;

/**
 * The 3D scene: drawn by the page itself, and while it is the large view by viser, with trail and ghost, in a frame of
 * its own. Until the frame shows an event, the page's own drawing stays in sight.
 */
export class SceneView {
  readonly element = h("div", "scene");
  readonly full: FullScene;
  private readonly drawing: SceneDrawing;
  private readonly words = h("p", "scene-words");
  private feedback: Feedback | null = null; // newest that was taken
  private openedMs = 0;
  private epoch: string | null = null;

  constructor(
    api: ConsoleApi,
    private readonly page: SceneSurroundings,
  ) {
    this.drawing = new SceneDrawing(() => page.due(), page.display);
    this.element.append(this.drawing.element, this.words);
    this.full = new FullScene(api, this.element, page);
  }

  /** Begins to draw the robot. */
  open(description: RobotDescription): void {
    if (this.drawing.state !== "off") return;
    this.openedMs = performance.now();
    this.drawing.open(description);
  }

  /** Ends it; what it drew is gone with it. */
  close(): void {
    this.full.close();
    this.drawing.close();
  }

  /** It lives as long as the bridge whose robot it shows: the robot of another one may have another shape. */
  follow(epoch: string | null): void {
    if (epoch === null || epoch === this.epoch) return;
    const isFirst = this.epoch === null;
    this.epoch = epoch;
    if (isFirst) return;
    const wasOpen = this.full.isOpen;
    this.close();
    this.drawing.forget();
    if (wasOpen) this.full.open();
  }

  /** Whether there is nothing to be seen, and will not be. */
  get hasFailed(): boolean {
    return this.state() === "failed";
  }

  /** Whether it has run long enough that its loading no longer holds the page up. */
  hasSettled(now: number): boolean {
    const runs = this.full.state === "on" || this.drawing.state === "on";
    return runs && now - Math.max(this.openedMs, this.full.changedMs) > SETTLE_MS;
  }

  /** Takes the newest feedback, and goes on to the event of the picture that is now on screen. */
  take(feedback: Feedback | null): void {
    if (feedback !== null && feedback !== this.feedback) this.drawing.take(feedback);
    this.feedback = feedback;
    this.settle();
  }

  settle(): void {
    this.full.settle();
    if (!this.full.isShown) this.drawing.settle();
  }

  /** Writes what stands in it. */
  update(): void {
    const state = this.state();
    setData(this.element, "state", state);
    const { full, drawing } = this;
    if (drawing.state === "failed" && !full.isOpen) setText(this.words, FAILED);
    else if (full.isShown) setText(this.words, "");
    else setText(this.words, drawing.state === "loading" ? "Opening the 3D scene…" : full.words);
  }

  /** Why it must not be trusted; null when it may, or shows nothing. `age`: of the feedback, once that is too old. */
  staleness(age: string | null): string | null {
    const { shown } = this;
    const showsNothing = this.full.state !== "on" && this.drawing.state !== "on";
    return showsNothing ? null : sceneStaleness({ shown }, this.page.context(), age);
  }

  /** Whether joints of what is shown were not measured. */
  get lacksJoints(): boolean {
    return !this.full.isShown && this.drawing.lacksJoints;
  }

  statistics(): SceneStatistics {
    const { held, forced } = this.full.gate;
    const { feedback } = this.page.context();
    const { shown } = this;
    const gap = shown === null || feedback === null ? null : eventGap(feedback, shown);
    return { state: this.state(), event: shown, gap, held: held.length, forced };
  }

  private state(): SceneState {
    if (this.full.isShown) return "full";
    if (this.drawing.state === "on") return this.drawing.shown === null ? "loading" : "drawn";
    if (this.drawing.state === "failed") return this.full.isOpen ? "loading" : "failed";
    return this.drawing.state === "loading" || this.full.isOpen ? "loading" : "away";
  }

  private get shown(): number | null {
    return this.full.isShown ? this.full.gate.shown : this.drawing.shown;
  }
}
