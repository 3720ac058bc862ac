import { createSceneGate, resetSceneGate, sceneStaleness, settleScene } from "../gate/scene_gate";
import { eventGap } from "../gate/serial";
import type { GateContext } from "../gate/gate_counters";
import type { ConsoleApi } from "../transport/signalling/console_api";
import type { Feedback, RobotDescription } from "../protocol/wire";
import type { Display } from "../input/display";
import { h, setData, setText } from "../ui/elements/dom";
import { SceneDrawing } from "./scene_drawing";
import { gateScene, type ForeignKey } from "./scene_frame";

type FrameState = "off" | "loading" | "on" | "failed";
/** What is to be seen. `full`: viser's, in its frame. `drawn`: the page's own. */
type SceneState = "away" | "loading" | "drawn" | "full" | "failed";

/** What the page knows that the scene has to keep to. */
export interface SceneSurroundings {
  /** Newest event that the scene may show. */
  due(): number | "all" | null;
  context(): GateContext;
  /** Whose frames it draws in. */
  readonly display: Display;
  /** Keys pressed while the frame has the focus, which the page itself never sees. */
  onkey(key: ForeignKey): void;
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
const FRAME_WORDS: Readonly<Record<FrameState, string>> = {
  off: "",
  loading: "Opening the full 3D scene…",
  on: "Opening the full 3D scene…",
  failed: "The full 3D scene is not available now",
};
const SETTLE_MS = 5000;

/**
 * The 3D scene: drawn by the page itself, and while it is the large view by viser, with trail and ghost, in a frame of
 * its own. Until the frame shows an event, the page's own drawing stays in sight.
 */
export class SceneView {
  readonly element = h("div", "scene");
  readonly gate = createSceneGate();
  private readonly drawing: SceneDrawing;
  private readonly words = h("p", "scene-words");
  private frame: HTMLIFrameElement | null = null;
  private frameState: FrameState = "off";
  private feedback: Feedback | null = null; // newest that was taken
  private openedMs = 0;

  constructor(
    private readonly api: ConsoleApi,
    private readonly page: SceneSurroundings,
  ) {
    this.drawing = new SceneDrawing(() => page.due(), page.display);
    this.element.append(this.drawing.element, this.words);
    gateScene(this.gate, () => this.frame?.contentWindow ?? null, page);
  }

  /** Begins to draw the robot. */
  open(description: RobotDescription): void {
    if (this.drawing.state !== "off") return;
    this.openedMs = performance.now();
    this.drawing.open(description);
  }

  /** Ends it; what it drew is gone with it. */
  close(): void {
    this.unload();
    this.drawing.close();
  }

  /** Opens the full scene unless it is open. */
  load(): void {
    if (this.frameState === "on" || this.frameState === "loading") return;
    this.frameState = "loading";
    this.api.scene().then(
      (path) => this.embed(path),
      () => {
        if (this.frameState === "loading") this.frameState = "failed";
      },
    );
  }

  /** Ends the full scene. */
  unload(): void {
    this.frame?.remove();
    this.frame = null;
    this.frameState = "off";
    this.openedMs = performance.now();
    resetSceneGate(this.gate);
  }

  /** Another bridge, whose robot may have another shape. */
  renew(): void {
    const wasLoaded = this.isFull;
    this.close();
    this.drawing.forget();
    if (wasLoaded) this.load();
  }

  /** Whether the full scene is open, or opening. */
  get isFull(): boolean {
    return this.frameState === "on" || this.frameState === "loading";
  }

  /** Whether there is nothing to be seen, and will not be. */
  get hasFailed(): boolean {
    return this.state() === "failed";
  }

  /** Whether it has run long enough that its loading no longer holds the page up. */
  hasSettled(now: number): boolean {
    const runs = this.frameState === "on" || this.drawing.state === "on";
    return runs && now - this.openedMs > SETTLE_MS;
  }

  /** Takes the newest feedback, and goes on to the event of the picture that is now on screen. */
  take(feedback: Feedback | null): void {
    if (feedback !== null && feedback !== this.feedback) this.drawing.take(feedback);
    this.feedback = feedback;
    this.settle();
  }

  settle(): void {
    if (this.frameState === "on") settleScene(this.gate, this.page.due());
    if (!this.showsFull) this.drawing.settle();
  }

  /** Writes what stands in it. */
  update(): void {
    const state = this.state();
    setData(this.element, "state", state);
    setText(this.words, this.drawing.state === "failed" && !this.isFull ? FAILED : this.frameWords());
  }

  /** Why it must not be trusted; null when it may, or shows nothing. `age`: of the feedback, once that is too old. */
  staleness(age: string | null): string | null {
    const { shown } = this;
    const showsNothing = this.frameState !== "on" && this.drawing.state !== "on";
    return showsNothing ? null : sceneStaleness({ shown }, this.page.context(), age);
  }

  /** Whether joints of what is shown were not measured. */
  get lacksJoints(): boolean {
    return !this.showsFull && this.drawing.lacksJoints;
  }

  statistics(): SceneStatistics {
    const { held, forced } = this.gate;
    const { feedback } = this.page.context();
    const { shown } = this;
    const gap = shown === null || feedback === null ? null : eventGap(feedback, shown);
    return { state: this.state(), event: shown, gap, held: held.length, forced };
  }

  private state(): SceneState {
    if (this.showsFull) return "full";
    if (this.drawing.state === "on") return this.drawing.shown === null ? "loading" : "drawn";
    if (this.drawing.state === "failed") return this.isFull ? "loading" : "failed";
    return this.drawing.state === "loading" || this.isFull ? "loading" : "away";
  }

  /** Whether what is to be seen is the frame's. */
  private get showsFull(): boolean {
    return this.frameState === "on" && this.gate.shown !== null;
  }

  private get shown(): number | null {
    return this.showsFull ? this.gate.shown : this.drawing.shown;
  }

  private frameWords(): string {
    if (this.showsFull) return "";
    return this.drawing.state === "loading" ? "Opening the 3D scene…" : FRAME_WORDS[this.frameState];
  }

  private embed(path: string): void {
    if (this.frameState !== "loading") return;
    resetSceneGate(this.gate);
    // Whatever runs in there has an origin that is nobody's; the console says the same of it (server/lockstep/server/http/security_headers.py).
    const attributes = { src: path, title: "3D scene of the robot", sandbox: "allow-scripts" };
    this.frame = h("iframe", "scene-frame", attributes);
    this.element.append(this.frame);
    this.openedMs = performance.now();
    this.frameState = "on";
  }
}
