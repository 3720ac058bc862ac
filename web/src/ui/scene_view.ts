import { createSceneGate, resetSceneGate, sceneStaleness, settleScene } from "../core/scene_gate";
import { eventGap } from "../core/serial";
import type { GateContext } from "../core/medium_counts";
import type { ConsoleApi } from "../rtc/console_api";
import { button, h, setHidden, setText } from "./dom";
import { gateScene, type ForeignKey } from "./scene_frame";

type SceneState = "off" | "loading" | "on" | "failed" | "empty";

/** What the page knows that the scene has to keep to. */
export interface SceneSurroundings {
  /** Newest event that the scene may show. */
  due(): number | "all" | null;
  context(): GateContext;
  /** Keys pressed while the frame has the focus, which the page itself never sees. */
  onkey(key: ForeignKey): void;
}

/** `window.lockstep.scene()` */
export interface SceneStatistics {
  readonly state: SceneState;
  readonly event: number | null; // shown
  readonly gap: number | null; // feedback's event minus the shown one
  readonly held: number; // updates that wait for their event
  readonly forced: number; // updates that could not wait
}

const IDLE_WORDS = "The robot, posed from its feedback";
const EMPTY_WORDS = "This robot does not describe its shape, so there is no 3D scene of it";
const SETTLE_MS = 5000;

/** The 3D scene in a frame of its own. It runs only while it is the large view: drawing it takes from the pictures. */
export class SceneView {
  readonly element = h("div", "scene");
  readonly gate = createSceneGate();
  private readonly words = h("p", "scene-words");
  private readonly open = button("wide-button", "Open the 3D scene", () => this.load());
  private frame: HTMLIFrameElement | null = null;
  private state: SceneState = "off";
  private openedMs = 0;

  constructor(
    private readonly api: ConsoleApi,
    private readonly page: SceneSurroundings,
  ) {
    this.element.append(h("div", "scene-idle", {}, this.words, this.open));
    this.show("off", IDLE_WORDS);
    gateScene(this.gate, () => this.frame?.contentWindow ?? null, page);
  }

  /** Opens the scene unless it is open, or there is nothing to show. */
  load(): void {
    if (this.state === "on" || this.state === "loading" || this.state === "empty") return;
    this.show("loading", "Opening the 3D scene…");
    this.api.scene().then(
      (path) => this.embed(path),
      () => {
        if (this.state === "loading") this.show("failed", "The 3D scene is not available");
      },
    );
  }

  /** Ends it; what it drew is gone with it. */
  unload(words = IDLE_WORDS): void {
    if (this.state === "off" || this.state === "empty") return;
    this.discard();
    this.show("off", words);
  }

  /** Whether the robot has a shape to show. */
  setPossible(possible: boolean): void {
    if (possible === (this.state !== "empty")) return;
    this.discard();
    this.show(possible ? "off" : "empty", possible ? IDLE_WORDS : EMPTY_WORDS);
  }

  /** Whether it has run long enough that its loading no longer holds the page up. */
  hasSettled(now: number): boolean {
    return this.state === "on" && now - this.openedMs > SETTLE_MS;
  }

  /** Opens it anew if it is open. */
  reload(): void {
    if (this.state === "off" || this.state === "empty") return;
    this.unload();
    this.load();
  }

  /** Lets the scene go on to the event of the picture that is now on screen. */
  settle(): void {
    if (this.state === "on") settleScene(this.gate, this.page.due());
  }

  /** Why it must not be trusted; null when it may, or is not there. */
  staleness(): string | null {
    return this.state === "on" ? sceneStaleness(this.gate, this.page.context()) : null;
  }

  statistics(): SceneStatistics {
    const { shown, held, forced } = this.gate;
    const { feedback } = this.page.context();
    const gap = shown === null || feedback === null ? null : eventGap(feedback, shown);
    return { state: this.state, event: shown, gap, held: held.length, forced };
  }

  private embed(path: string): void {
    if (this.state !== "loading") return;
    resetSceneGate(this.gate);
    // Whatever runs in there has an origin that is nobody's; the console says the same of it (server/security.py).
    const attributes = { src: path, title: "3D scene of the robot", sandbox: "allow-scripts" };
    this.frame = h("iframe", "scene-frame", attributes);
    this.element.append(this.frame);
    this.openedMs = performance.now();
    this.show("on", "");
  }

  private discard(): void {
    this.frame?.remove();
    this.frame = null;
    resetSceneGate(this.gate);
  }

  private show(state: SceneState, words: string): void {
    this.state = state;
    this.element.dataset["state"] = state;
    setHidden(this.open, state === "empty");
    setText(this.words, words);
  }
}
