import {
  createScenePoses,
  forgetPoses,
  keepPose,
  poseDue,
  type ScenePose,
  type ScenePoses,
} from "../gate/scene_poses";
import type { Display } from "../input/display";
import type { SceneRenderer } from "./scene_renderer";
import type { RobotDescription } from "../protocol/wire";
import { h, setText } from "../ui/elements/dom";

const DISTANCE = 2.6; // of the look, in the robot's radii: it is small most of the time

type DrawingState = "off" | "loading" | "on" | "failed";

/**
 * The robot as this page draws it, from the feedback that it gets anyway: no stream of its own, nothing to ask the
 * console for but the code, once. It draws the event that is due when the browser makes its next picture.
 */
export class SceneDrawing {
  readonly element = h("div", "scene-drawing");
  state: DrawingState = "off";
  shown: number | null = null; // event
  lacksJoints = false; // in what is shown: not all were measured
  private readonly scale = h("span", "scene-scale");
  private readonly poses: ScenePoses = createScenePoses();
  private canvas: HTMLCanvasElement | null = null;
  private stage: SceneRenderer | null = null;
  private pose: ScenePose | null = null; // shown
  private frame = 0; // asked of the browser; 0: none is

  constructor(
    private readonly due: () => number | "all" | null,
    private readonly display: Display,
  ) {}

  open(description: RobotDescription): void {
    if (this.state !== "off") return;
    this.state = "loading";
    void this.load(description);
  }

  close(): void {
    this.display.cancel(this.frame);
    this.stage?.close();
    this.stage = null;
    this.canvas = null;
    this.element.replaceChildren();
    this.frame = 0;
    this.state = "off";
    this.blank();
  }

  /** The newest feedback. */
  take(pose: ScenePose): void {
    keepPose(this.poses, pose);
  }

  /** Another robot or bridge. */
  forget(): void {
    forgetPoses(this.poses);
    this.blank();
  }

  /** Something is due, or may be. */
  settle(): void {
    if (this.state !== "on" || this.frame !== 0) return;
    this.frame = this.display.request(() => {
      this.frame = 0;
      this.draw();
    });
  }

  private async load(description: RobotDescription): Promise<void> {
    const canvas = h("canvas", "scene-canvas", {
      role: "img",
      "aria-label": "The robot as its feedback says",
    });
    this.canvas = canvas;
    this.element.replaceChildren(canvas, this.scale);
    try {
      const { SceneRenderer } = await import("./scene_renderer");
      if (this.canvas !== canvas) return;
      this.stage = new SceneRenderer(canvas, description, this.display, DISTANCE);
      setText(this.scale, this.stage.scale);
      this.state = "on";
    } catch {
      if (this.canvas === canvas) this.state = "failed";
      return;
    }
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault(); // it may come back; until then nothing is shown
      if (this.canvas === canvas) this.blank();
    });
    this.settle();
  }

  private draw(): void {
    const pose = poseDue(this.poses, this.due());
    if (this.stage === null || pose === null || pose === this.pose || this.stage.isLost) return;
    this.stage.show(pose);
    this.pose = pose;
    this.shown = pose.event;
    this.lacksJoints = pose.unknown.length > 0;
  }

  private blank(): void {
    this.pose = null;
    this.shown = null;
    this.lacksJoints = false;
  }
}
