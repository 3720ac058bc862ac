import { Color, GridHelper, Group, PerspectiveCamera, Scene, type Object3D } from "three";
import { layoutPanels } from "../xr/panel_layout";
import { pressable, type ButtonName } from "../xr/headset_buttons";
import { pairStreams, type PanelStreams } from "../xr/stereo_pairs";
import { about, heading, type Quaternion, type RigidPose } from "../util/rigid";
import type { Side } from "../xr/headset_input";
import { CanvasPanel } from "./canvas_panel";
import { drawButton, drawStatus } from "./panel_drawings";
import { PicturePanel, type PanelState } from "./picture_panel";
import { Pointers } from "./pointers";
import type { HeadsetStatus } from "./status";
import type { HandReading } from "./xr_hands";

/** The content of the view at one frame. */
export interface ViewState {
  readonly cameras: readonly ViewCamera[]; // in their order
  readonly main: string | null; // stream of the large picture
  readonly status: HeadsetStatus;
  readonly stop: string; // below STOP: what became of it
  readonly reset: { readonly text: string; readonly ready: boolean } | null; // null: nothing to reset
}

/** One camera as the page has it now. */
export interface ViewCamera {
  readonly name: string;
  readonly label: string;
  readonly canvas: HTMLCanvasElement;
  readonly drawnMs: number | null;
  readonly gap: string;
  readonly veil: string | null;
}

const BACKGROUND = 0x0b0e11;
const GRID = 0x1d2730;
const BELOW = -0.96; // m from the eyes: the middle of the row below the pictures
const NEARER = -1.42;
const TILT = -0.42; // rad: it faces the eyes
const STATUS = { width: 1.5, height: 0.56 };

interface Button {
  readonly panel: CanvasPanel;
  readonly name: ButtonName;
}

/** The room: pictures in front, state and buttons below them. It stands still; only the person moves it, by recentring. */
export class HeadsetView {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(70, 1, 0.05, 60);
  pictures: PicturePanel[] = [];
  forward = 0; // the operator's heading when the room was placed, rad
  private readonly room = new Group();
  private readonly status = new CanvasPanel(STATUS.width, STATUS.height);
  private readonly buttons: readonly Button[];
  private readonly pointers = new Pointers();
  private readonly floor = new GridHelper(10, 20, GRID, GRID);
  private laidOut = "";
  private pointed = new Map<Side, ButtonName>(); // also by a hand that may not press it

  /** `opaque`: nothing of the real room is seen. */
  constructor(opaque: boolean) {
    this.scene.background = opaque ? new Color(BACKGROUND) : null;
    this.floor.visible = opaque;
    this.buttons = [
      this.button("stop", 0.4, 0.56, 0.98, 0),
      this.button("recentre", 0.34, 0.13, -0.58, -0.37),
      this.button("leave", 0.34, 0.13, -0.2, -0.37),
      this.button("reset", 0.62, 0.13, 0.34, -0.37),
    ];
    const row = new Group();
    row.position.set(-0.22, BELOW, NEARER);
    row.rotation.x = TILT;
    row.add(this.status.mesh, ...this.buttons.map(({ panel }) => panel.mesh));
    this.room.add(row);
    this.scene.add(this.room, this.floor, this.pointers.group);
  }

  /** In front of whoever looks from here. */
  recentre(viewer: RigidPose): void {
    const [x, y, z] = viewer.position;
    this.forward = heading(viewer.orientation);
    this.room.position.set(x, y, z);
    this.room.rotation.y = this.forward;
    this.floor.position.set(Math.round(x), 0, Math.round(z));
  }

  /** `now`: performance.now(), right before the frame is drawn. */
  update(state: ViewState, hands: readonly HandReading[], held: ReadonlySet<Side>, now: number): void {
    this.layOut(state);
    for (const panel of this.pictures) {
      const shown = panelState(panel.streams, state.cameras);
      if (shown !== null) panel.update(shown, now);
    }
    this.status.show(JSON.stringify(state.status), (...at) => drawStatus(...at, state.status));
    this.point(hands, held, state);
    this.drawButtons(state, held);
  }

  /** The button that the hand points at and may press; null: none. */
  buttonAt(side: Side, drives: boolean): ButtonName | null {
    return pressable(this.pointed.get(side) ?? null, drives);
  }

  /** How a camera's picture stands in the headset's space; null: it is not shown. */
  panelOf(camera: string): Quaternion | null {
    const found = this.pictures.find(({ streams }) => streams.left === camera || streams.right === camera);
    return found === undefined ? null : about([0, 1, 0], this.room.rotation.y + found.group.rotation.y);
  }

  close(): void {
    for (const panel of [...this.pictures, this.status, ...this.buttons.map(({ panel }) => panel)])
      panel.close();
    this.pointers.close();
    this.floor.geometry.dispose();
    this.floor.material.dispose();
  }

  private button(name: ButtonName, width: number, height: number, x: number, y: number): Button {
    const panel = new CanvasPanel(width, height);
    panel.mesh.position.set(x, y, 0);
    return { name, panel };
  }

  /** Only when cameras came or went, have another shape, or another one is large. */
  private layOut({ cameras, main }: ViewState): void {
    const shapeOf = ({ canvas }: ViewCamera): number => canvas.width / Math.max(1, canvas.height);
    const key = JSON.stringify([main, cameras.map((camera) => [camera.name, shapeOf(camera).toFixed(2)])]);
    if (key === this.laidOut) return;
    this.laidOut = key;
    for (const panel of this.pictures) {
      panel.group.removeFromParent();
      panel.close();
    }
    const isMain = (pair: PanelStreams): boolean => pair.left === main || pair.right === main;
    const pairs = pairStreams(cameras.map(({ name }) => name)).toSorted(
      (one, other) => Number(isMain(other)) - Number(isMain(one)),
    );
    const shapes = pairs.map(({ left }) => {
      const camera = cameras.find(({ name }) => name === left);
      return camera === undefined ? 1 : shapeOf(camera);
    });
    const places = layoutPanels(shapes);
    this.pictures = pairs.flatMap((pair, index) => {
      const place = places[index];
      return place === undefined ? [] : [new PicturePanel(pair, place)];
    });
    this.room.add(...this.pictures.map(({ group }) => group));
  }

  private point(hands: readonly HandReading[], held: ReadonlySet<Side>, state: ViewState): void {
    this.scene.updateMatrixWorld();
    const live = this.buttons.filter(({ name }) => name !== "reset" || state.reset !== null);
    const met = this.pointers.update(
      hands,
      held,
      live.map(({ panel }) => panel.mesh),
    );
    const nameOf = (object: Object3D): ButtonName | undefined =>
      live.find(({ panel }) => panel.mesh === object)?.name;
    this.pointed = new Map(
      [...met].flatMap(([side, object]) => {
        const name = nameOf(object);
        return name === undefined ? [] : [[side, name] as const];
      }),
    );
  }

  private drawButtons(state: ViewState, held: ReadonlySet<Side>): void {
    const pointed = new Set([...this.pointed.keys()].map((side) => this.buttonAt(side, held.has(side))));
    const looks: Readonly<Record<ButtonName, readonly [string, string, string]>> = {
      stop: ["STOP", state.stop, "#c8102e"],
      recentre: ["Recentre", "", "#1b232b"],
      leave: ["Leave", "", "#1b232b"],
      reset: [state.reset?.text ?? "", "", state.reset?.ready === true ? "#8a4b00" : "#3a3f45"],
    };
    for (const { name, panel } of this.buttons) {
      panel.mesh.visible = name !== "reset" || state.reset !== null;
      const [words, about, fill] = looks[name];
      const isPointed = pointed.has(name);
      panel.show(`${words} ${about} ${fill} ${isPointed}`, (...at) =>
        drawButton(...at, words, about, fill, isPointed),
      );
    }
  }
}

/** Of a pair both must be present: two eyes never see two states that far apart. */
function panelState({ left, right }: PanelStreams, cameras: readonly ViewCamera[]): PanelState | null {
  const one = cameras.find(({ name }) => name === left);
  const other = cameras.find(({ name }) => name === right);
  if (one === undefined || other === undefined) return null;
  return { left: one, right: other, label: one.label, gap: one.gap, veil: one.veil ?? other.veil };
}
