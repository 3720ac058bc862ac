import {
  CanvasTexture,
  LinearMipmapLinearFilter,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  SRGBColorSpace,
} from "three";
import { h } from "../ui/elements/dom";

const PIXELS_PER_METRE = 900; // about what today's headsets resolve at the distance of the panels

export type PanelDrawing = (context: CanvasRenderingContext2D, width: number, height: number) => void;

/** A flat panel in the room on which text and figures are drawn; 1 m is 900 pixels. */
export class CanvasPanel {
  readonly mesh: Mesh<PlaneGeometry, MeshBasicMaterial>;
  private readonly canvas = h("canvas");
  private readonly texture: CanvasTexture;
  private shown: string | null = null;

  /** `width` and `height` in m. */
  constructor(width: number, height: number) {
    this.canvas.width = Math.round(width * PIXELS_PER_METRE);
    this.canvas.height = Math.round(height * PIXELS_PER_METRE);
    this.texture = textureOf(this.canvas);
    const material = new MeshBasicMaterial({ map: this.texture, transparent: true, toneMapped: false });
    this.mesh = new Mesh(new PlaneGeometry(width, height), material);
  }

  /** Draws anew unless `content`, which names what is drawn, is the same as before. */
  show(content: string, draw: PanelDrawing): void {
    if (content === this.shown) return;
    this.shown = content;
    const context = this.canvas.getContext("2d");
    if (context === null) return;
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    draw(context, this.canvas.width, this.canvas.height);
    this.texture.needsUpdate = true;
  }

  close(): void {
    this.texture.dispose();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}

/** A texture that stays sharp and calm when it is seen from the side. */
export function textureOf(canvas: HTMLCanvasElement): CanvasTexture {
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = 4;
  texture.minFilter = LinearMipmapLinearFilter;
  return texture;
}
