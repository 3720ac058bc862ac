import type { ReplayFeedback } from "../chunk";
import type { RobotDescription } from "../../protocol/wire";
import { Display } from "../../input/display";
import { grouped, h, setHidden, setText } from "../../ui/elements/dom";
import type { SceneRenderer } from "../../scene/scene_renderer";

export type SceneCardState = "waiting" | "loading" | "on" | "failed";

/** The 3D scene of the event that is shown. What draws it is loaded only when something has been shown. */
export class SceneCard {
  readonly element: HTMLElement;
  private readonly canvas = h("canvas", "picture", { role: "img" });
  private readonly words = h("p", "replay-empty", {}, "Opening the 3D scene …");
  private readonly stamp = h("span", "view-stamp");
  private readonly scale = h("span", "scene-scale");
  private state: SceneCardState = "waiting";
  private stage: SceneRenderer | null = null;
  private shown: { event: number; feedback: ReplayFeedback | null; damaged: boolean } | null = null;
  private closed = false;

  constructor(private readonly description: RobotDescription) {
    const caption = h("figcaption", "view-caption", {}, h("span", "view-label", {}, "3D scene"), this.stamp);
    this.element = h(
      "figure",
      "view replay-view replay-scene",
      {},
      this.canvas,
      this.words,
      caption,
      this.scale,
    );
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault()); // it may come back
  }

  /** The robot as feedback `event` measured it; null: that was not recorded, or cannot be read. */
  show(event: number, feedback: ReplayFeedback | null, damaged: boolean): void {
    this.shown = { event, feedback, damaged };
    this.draw();
    if (this.state === "waiting") void this.load();
  }

  close(): void {
    this.closed = true;
    this.stage?.close();
    this.stage = null;
  }

  /** What stands in the scene, for tests: the event, and where each body is, in metres. */
  statistics(): object {
    const { stage, shown, state } = this;
    const names = stage === null ? [] : [...stage.model.bodies.keys()];
    const bodies = names.map((name) => [name, stage?.model.positionOf(name)?.toArray() ?? null]);
    const drawn = stage !== null && (shown?.feedback ?? null) !== null;
    return { state, event: drawn ? shown?.event : null, bodies: Object.fromEntries(bodies) as object };
  }

  private async load(): Promise<void> {
    this.state = "loading";
    try {
      const { SceneRenderer } = await import("../../scene/scene_renderer");
      if (this.closed) return;
      this.stage = new SceneRenderer(this.canvas, this.description, new Display());
      this.state = "on";
      setText(this.scale, this.stage.scale);
    } catch {
      this.state = "failed";
    }
    this.draw();
  }

  private draw(): void {
    const { shown, stage } = this;
    if (this.state === "failed")
      setText(this.words, "This browser cannot draw the 3D scene: it has no WebGL");
    if (shown === null || stage === null) return;
    const { event, feedback, damaged } = shown;
    const why = damaged ? "This part of the recording is damaged" : "No state of this event was recorded";
    const missing = feedback === null ? why : "";
    setHidden(this.words, missing === "");
    setText(this.words, missing);
    this.canvas.classList.toggle("is-blank", feedback === null);
    const stopped = feedback?.stopped === true ? " · STOPPED" : "";
    const unknown = feedback !== null && this.lacksJoints(feedback) ? " · not all joints measured" : "";
    setText(this.stamp, feedback === null ? "" : `s ${grouped(event)}${stopped}${unknown}`);
    this.canvas.setAttribute("aria-label", `The robot at event ${event}`);
    if (feedback !== null) stage.show(feedback);
  }

  private lacksJoints(feedback: ReplayFeedback): boolean {
    return this.description.joints.some((joint) => feedback.unknown.includes(joint.name));
  }
}
