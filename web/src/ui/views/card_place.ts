import type { MovableCard } from "./view_layout";
import { setData } from "../elements/dom";

const WIDTH = 150;
const HEIGHT = 64;

/** The card that may stand at the end of a row of small views, where the style sheet lets it. */
export class CardPlace {
  card: HTMLElement | null = null;
  private height = 0; // in its own place

  /** null: there is none, or this screen has a place of its own for it. */
  measure(): MovableCard | null {
    if (this.card === null) return null;
    if (getComputedStyle(this.card).getPropertyValue("--moves") !== "1") return null;
    if (!this.isBeside) this.height = this.card.offsetHeight;
    return { height: this.height, leastWidth: WIDTH, leastHeight: HEIGHT };
  }

  /** Whether it stands beside the small views now, and not in its own place. */
  get isBeside(): boolean {
    return this.card?.dataset.beside === "true";
  }

  /** `size`: of the small views; `taken`: width that they take before it. Both in pixels. */
  lay(isBeside: boolean, size: number, taken: number): void {
    if (this.card === null) return;
    setData(this.card, "beside", String(isBeside));
    this.card.style.setProperty("--size", `${size}px`);
    this.card.style.setProperty("--taken", `${taken}px`);
  }
}
