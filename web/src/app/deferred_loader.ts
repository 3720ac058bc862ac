import type * as parts from "./deferred_parts";
import { h, type Panel } from "../ui/elements/dom";

export type DeferredParts = typeof parts;

const RETRY_MS = 5000;

/** Parts of the page whose code comes after the first picture, and what waits for it. */
export class DeferredLoader {
  private loading: Promise<DeferredParts> | null = null;
  private triedMs = -Infinity;
  private readonly waiting: ((parts: DeferredParts) => void)[] = [];
  private parts: DeferredParts | null = null;

  /** `failed`: it could not be loaded; it is tried again. */
  constructor(private readonly failed: () => void) {}

  /** Loads it unless that is done; to be called again and again. */
  load(now: number): void {
    if (this.loading !== null || now - this.triedMs < RETRY_MS) return;
    this.triedMs = now;
    this.loading = import("./deferred_parts");
    this.loading.then(
      (parts) => {
        this.parts = parts;
        for (const use of this.waiting.splice(0)) use(parts);
      },
      () => {
        this.loading = null;
        this.failed();
      },
    );
  }

  /** With the parts, as soon as they are there. */
  use(then: (parts: DeferredParts) => void): void {
    if (this.parts !== null) then(this.parts);
    else this.waiting.push(then);
  }

  /** A panel whose place stays empty until then. */
  panel(create: (parts: DeferredParts) => Panel): Panel {
    let panel: Panel | null = null;
    const place = h("div");
    place.hidden = true;
    this.use((parts) => {
      panel = create(parts);
      panel.update(performance.now());
      place.replaceWith(panel.element);
    });
    return { element: place, update: (now) => panel?.update(now) };
  }
}
