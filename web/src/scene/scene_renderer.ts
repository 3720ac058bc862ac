import {
  Color,
  DirectionalLight,
  GridHelper,
  Group,
  HemisphereLight,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Display } from "../input/display";
import { lengthLabel, roundLength } from "../util/units";
import type { RobotDescription } from "../protocol/wire";
import { RobotModel } from "./robot_model";
import { addAnnotations, type SceneState } from "./robot_annotations";

const BACKGROUND = 0x10141a;
const GRID = 0x4d5a6b;
const GRID_MIDDLE = 0x66768a;
const CELLS = 40;
const CELL_SHARE = 0.5; // of the robot's radius, at most
const LIFT = 0.012; // of the robot's radius: the squares show on a floor of the robot's own
const SHARPEST = 2; // device pixels to a CSS pixel

/** Draws one robot on one canvas, when there is something new to draw. Everything is scaled to a robot of radius 1. */
export class SceneRenderer {
  readonly scale: string; // "small square: 0.5 m"
  readonly model: RobotModel;
  private readonly scene = new Scene();
  private readonly world = new Group();
  private readonly camera = new PerspectiveCamera(45, 1, 0.02, 200);
  private readonly renderer: WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly floor: GridHelper;
  private readonly signs: ReturnType<typeof addAnnotations>;
  private readonly resizes: ResizeObserver;
  private readonly cell: number; // m
  private seen = new Vector3(); // where the robot was in the last picture
  private frame = 0;

  /** `distance`: of the first look, in the robot's radii. Raises where the browser has no WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    description: RobotDescription,
    private readonly display: Display,
    private readonly distance = 4.2,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.model = new RobotModel(description);
    const { center, radius } = this.model.extent();
    this.signs = addAnnotations(this.model, description, radius);
    this.cell = roundLength(CELL_SHARE * radius);
    this.scale = `small square: ${lengthLabel(this.cell)}`;
    this.floor = new GridHelper(CELLS * this.cell, CELLS, GRID_MIDDLE, GRID).rotateX(Math.PI / 2);
    this.floor.position.z = LIFT * radius;
    this.world.add(this.model.root, this.floor);
    this.world.scale.setScalar(1 / radius);
    const sun = new DirectionalLight(0xffffff, 2.2);
    sun.position.set(-2, -3, 5);
    this.scene.background = new Color(BACKGROUND);
    this.scene.add(this.world, new HemisphereLight(0xcfe2ff, 0x39414d, 1.6), sun);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.drawSoon());
    this.look(center.divideScalar(radius));
    canvas.addEventListener("webglcontextrestored", () => this.drawSoon());
    this.resizes = new ResizeObserver(() => this.resize());
    this.resizes.observe(canvas);
    this.resize();
  }

  /** The robot as it was measured, at once. */
  show(state: SceneState): void {
    this.model.pose(state.joints);
    for (const sign of this.signs) sign.show(state);
    this.follow();
    this.draw();
  }

  /** Whether the browser has taken its WebGL away, for now or for good. */
  get isLost(): boolean {
    return this.renderer.getContext().isContextLost();
  }

  close(): void {
    this.display.cancel(this.frame);
    this.resizes.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  private look(center: Vector3): void {
    this.controls.target.copy(center);
    this.camera.position.copy(center).add(new Vector3(-0.62, -0.62, 0.55).multiplyScalar(this.distance));
    this.seen = this.model.focus().multiplyScalar(this.world.scale.x);
    this.controls.update();
  }

  /** The eye goes along with a robot that drives, and the floor's squares stay where they are in the world. */
  private follow(): void {
    const at = this.model.focus().multiplyScalar(this.world.scale.x);
    const moved = at.clone().sub(this.seen);
    this.seen = at;
    this.camera.position.add(moved);
    this.controls.target.add(moved);
    const { x, y } = at.clone().divideScalar(this.world.scale.x);
    this.floor.position.x = Math.round(x / this.cell) * this.cell;
    this.floor.position.y = Math.round(y / this.cell) * this.cell;
    this.controls.update();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(SHARPEST, devicePixelRatio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private drawSoon(): void {
    this.display.cancel(this.frame);
    this.frame = this.display.request(() => this.draw());
  }

  private draw(): void {
    this.renderer.render(this.scene, this.camera);
  }
}
