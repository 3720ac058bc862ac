import type { PictureLoader, PictureWanted } from "../picture_loader";
import { h, setData } from "../../ui/elements/dom";

/** Shows one picture of a recording; the newest wish wins. `close` it. */
export class PictureBox {
  readonly element: HTMLElement;
  private readonly image = h("img", "still-image", { decoding: "async", draggable: "false" });
  private readonly words = h("span", "still-words", { "aria-hidden": "true" });
  private asking: AbortController | null = null;
  private shown = ""; // what the wish was last made of

  constructor(
    private readonly pictures: PictureLoader,
    className: string,
  ) {
    this.image.alt = "";
    this.element = h("span", `still ${className}`, {}, this.image, this.words);
    setData(this.element, "state", "waiting");
  }

  /** `what`: for those who do not see it. null: there is no camera. */
  show(wanted: PictureWanted | null, what: string): void {
    this.image.alt = what;
    const key = JSON.stringify(wanted);
    if (key === this.shown) return;
    this.shown = key;
    this.asking?.abort();
    this.asking = null;
    if (wanted === null) {
      this.put(null, "No camera");
      return;
    }
    const known = this.pictures.known(wanted);
    if (known !== null) {
      this.put(known, "");
      return;
    }
    const asking = (this.asking = new AbortController());
    setData(this.element, "state", "waiting");
    this.words.textContent = "";
    void this.pictures.load(wanted, asking.signal).then((url) => {
      if (asking === this.asking && !asking.signal.aborted) this.put(url, "No picture");
    });
  }

  /** It is not seen any more: whoever scrolls on does not wait for it, and who comes back asks again. */
  rest(): void {
    if (this.element.dataset["state"] === "shown") return;
    this.asking?.abort();
    this.shown = "";
  }

  close(): void {
    this.asking?.abort();
  }

  private put(url: string | null, words: string): void {
    setData(this.element, "state", url === null ? "none" : "shown");
    this.words.textContent = url === null ? words : "";
    if (url === null) this.image.removeAttribute("src");
    else this.image.src = url;
  }
}
