import { createSceneGate, resetSceneGate, settleScene } from "../gate/scene_gate";
import type { ConsoleApi } from "../transport/signalling/console_api";
import { h } from "../ui/elements/dom";
import { gateScene, type SceneFrameEvents } from "./scene_frame";

type FrameState = "off" | "loading" | "on" | "failed";

const WORDS: Readonly<Record<FrameState, string>> = {
  off: "",
  loading: "Opening the full 3D scene…",
  on: "Opening the full 3D scene…",
  failed: "The full 3D scene is not available now",
};

/** The full scene: viser's, with trail and ghost, in a frame of its own. */
export class FullScene {
  readonly gate = createSceneGate();
  state: FrameState = "off";
  changedMs = 0; // when the frame was made or taken away last
  private frame: HTMLIFrameElement | null = null;

  constructor(
    private readonly api: ConsoleApi,
    private readonly place: HTMLElement,
    private readonly events: SceneFrameEvents,
  ) {
    gateScene(this.gate, () => this.frame?.contentWindow ?? null, events);
  }

  /** Opens it unless it is open. */
  open(): void {
    if (this.isOpen) return;
    this.state = "loading";
    this.api.scene().then(
      (path) => this.embed(path),
      () => {
        if (this.state === "loading") this.state = "failed";
      },
    );
  }

  close(): void {
    this.frame?.remove();
    this.frame = null;
    this.state = "off";
    this.changedMs = performance.now();
    resetSceneGate(this.gate);
  }

  /** Whether it is open, or opening. */
  get isOpen(): boolean {
    return this.state === "on" || this.state === "loading";
  }

  /** Whether it shows an event. */
  get isShown(): boolean {
    return this.state === "on" && this.gate.shown !== null;
  }

  /** What stands in its place until it shows an event. */
  get words(): string {
    return WORDS[this.state];
  }

  /** Goes on to the event that is due now. */
  settle(): void {
    if (this.state === "on") settleScene(this.gate, this.events.due());
  }

  private embed(path: string): void {
    if (this.state !== "loading") return;
    resetSceneGate(this.gate);
    // Whatever runs in there has an origin that is nobody's; the console says the same of it (server/lockstep/server/http/security_headers.py).
    const attributes = { src: path, title: "3D scene of the robot", sandbox: "allow-scripts" };
    this.frame = h("iframe", "scene-frame", attributes);
    this.place.append(this.frame);
    this.changedMs = performance.now();
    this.state = "on";
  }
}
