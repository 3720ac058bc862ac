import { keyOf } from "../episode_filter";
import type { Listed } from "../episode_list";
import type { PictureLoader } from "../picture_loader";
import { EpisodeRow, type RowEvents } from "./episode_row";
import { h } from "../../ui/elements/dom";

const MARGIN = "200px"; // around the screen, where pictures are loaded already

/** The rows of the list. Those that stay are not touched, so that what is focused stays so. */
export class EpisodeRows {
  readonly element = h("ol", "library-rows episode-rows", { "aria-label": "Episodes" });
  private readonly rows = new Map<string, EpisodeRow>();
  private readonly watcher = new IntersectionObserver((entries) => this.seen(entries), {
    root: null,
    rootMargin: MARGIN,
  });

  constructor(
    private readonly pictures: PictureLoader,
    private readonly mayEdit: boolean,
    private readonly events: RowEvents,
  ) {}

  /** Shows these episodes in this order. */
  place(listed: readonly Listed[]): void {
    const wanted = new Set(listed.map(keyOf));
    for (const [key, row] of this.rows) {
      if (wanted.has(key)) continue;
      this.watcher.unobserve(row.element);
      row.close();
      row.element.remove();
      this.rows.delete(key);
    }
    let before: Element | null = null;
    for (const each of listed) {
      const row = this.rowOf(each);
      const place: Element | null =
        before === null ? this.element.firstElementChild : before.nextElementSibling;
      if (place !== row.element) this.element.insertBefore(row.element, place);
      before = row.element;
    }
  }

  focus(key: string): void {
    this.rows.get(key)?.focus();
  }

  close(): void {
    this.watcher.disconnect();
    for (const row of this.rows.values()) row.close();
  }

  private rowOf(listed: Listed): EpisodeRow {
    const key = keyOf(listed);
    const known = this.rows.get(key);
    if (known !== undefined) {
      known.show(listed);
      return known;
    }
    const row = new EpisodeRow(listed, this.pictures, this.mayEdit, this.events);
    row.element.dataset["key"] = key;
    this.rows.set(key, row);
    this.watcher.observe(row.element);
    return row;
  }

  private seen(entries: readonly IntersectionObserverEntry[]): void {
    for (const { target, isIntersecting } of entries)
      this.rows.get((target as HTMLElement).dataset["key"] ?? "")?.seen(isIntersecting);
  }
}
