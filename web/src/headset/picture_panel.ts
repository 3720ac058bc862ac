import { Group, Mesh, MeshBasicMaterial, PlaneGeometry, type CanvasTexture } from "three";
import type { PanelPlace } from "../xr/panel_layout";
import type { PanelStreams } from "../xr/stereo_pairs";
import { CanvasPanel, textureOf } from "./canvas_panel";
import { drawCaption, drawVeil } from "./panel_drawings";

const CAPTION_HEIGHT = 0.075; // m
const LEFT_EYE = 1; // layers of three's XR cameras
const RIGHT_EYE = 2;
const BOTH_EYES = 0;
const PRESENT = 0xffffff;
const DIMMED = 0x5a5a5a; // of a picture below its veil

/** One camera's picture as the page has it now. */
export interface PanelPicture {
  readonly canvas: HTMLCanvasElement; // that the gate draws on, and nothing else does
  readonly drawnMs: number | null; // when it last did
}

/** The state of a panel's picture at one frame. */
export interface PanelState {
  readonly left: PanelPicture;
  readonly right: PanelPicture;
  readonly label: string;
  readonly gap: string; // "gap 1 of 3"
  readonly veil: string | null; // why it does not show the present state
}

/** The picture of a camera in the room, or of a pair of cameras with one picture for each eye. */
export class PicturePanel {
  readonly group = new Group();
  veil: string | null = null;
  uploadedMs: number | null = null; // when the newest picture was taken from its canvas
  waitedMs: number | null = null; // that it had waited on its canvas for the headset's frame
  private readonly eyes: readonly EyePicture[];
  private readonly caption: CanvasPanel;
  private readonly cover: CanvasPanel;

  constructor(
    readonly streams: PanelStreams,
    place: PanelPlace,
  ) {
    const { width, height } = place;
    const isPair = streams.left !== streams.right;
    this.eyes = isPair
      ? [new EyePicture(width, height, LEFT_EYE), new EyePicture(width, height, RIGHT_EYE)]
      : [new EyePicture(width, height, BOTH_EYES)];
    this.caption = new CanvasPanel(width, CAPTION_HEIGHT);
    this.caption.mesh.position.y = -(height + CAPTION_HEIGHT) / 2 - 0.008;
    this.cover = new CanvasPanel(width, height);
    this.cover.mesh.position.z = 0.004;
    this.cover.mesh.renderOrder = 1;
    this.cover.mesh.visible = false;
    this.group.add(...this.eyes.map(({ mesh }) => mesh), this.caption.mesh, this.cover.mesh);
    this.group.position.set(place.x, place.y, place.z);
    this.group.rotation.y = place.turn;
  }

  /** Takes what the gate has drawn since the last frame. `now`: performance.now(), right before this frame is drawn. */
  update(state: PanelState, now: number): void {
    for (const [index, eye] of this.eyes.entries()) {
      const picture = index === 0 ? state.left : state.right;
      if (!eye.take(picture)) continue;
      this.uploadedMs = now;
      this.waitedMs = now - (picture.drawnMs ?? now);
    }
    this.veil = state.veil;
    for (const { mesh } of this.eyes) mesh.material.color.setHex(state.veil === null ? PRESENT : DIMMED);
    const { veil } = state;
    this.cover.mesh.visible = veil !== null;
    if (veil !== null) this.cover.show(veil, (...at) => drawVeil(...at, veil));
    const { label, gap } = state;
    this.caption.show(`${label} ${gap} ${veil === null}`, (...at) =>
      drawCaption(...at, label, gap, veil === null),
    );
  }

  close(): void {
    for (const eye of this.eyes) eye.close();
    this.caption.close();
    this.cover.close();
  }
}

/** The part of a panel for one eye, or for both. */
class EyePicture {
  readonly mesh: Mesh<PlaneGeometry, MeshBasicMaterial>;
  private texture: CanvasTexture | null = null;
  private size = "";
  private drawnMs: number | null = null;

  constructor(width: number, height: number, layer: number) {
    const material = new MeshBasicMaterial({ toneMapped: false, visible: false });
    this.mesh = new Mesh(new PlaneGeometry(width, height), material);
    this.mesh.layers.set(layer);
  }

  /** Says whether there was a new one. Before the first nothing is to be seen. */
  take({ canvas, drawnMs }: PanelPicture): boolean {
    if (drawnMs === null || drawnMs === this.drawnMs) return false;
    this.drawnMs = drawnMs;
    const size = `${canvas.width}x${canvas.height}`;
    if (this.texture === null || size !== this.size || this.texture.image !== canvas)
      this.renew(canvas, size);
    if (this.texture !== null) this.texture.needsUpdate = true;
    return true;
  }

  close(): void {
    this.texture?.dispose();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }

  /** A texture keeps the size that it was made with. */
  private renew(canvas: HTMLCanvasElement, size: string): void {
    this.texture?.dispose();
    this.texture = textureOf(canvas);
    this.size = size;
    this.mesh.material.map = this.texture;
    this.mesh.material.visible = true;
    this.mesh.material.needsUpdate = true;
  }
}
