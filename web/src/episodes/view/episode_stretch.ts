import type { Listed } from "../episode_list";
import { eventAt, maySplit, type Handle, type Span } from "../episode_span";
import { titleOf } from "../episode_words";
import type { Change } from "../episodes_api";
import type { PictureLoader } from "../picture_loader";
import { PictureBox } from "./picture_box";
import { SpanTrack } from "./span_track";
import { button, grouped, h, setPressed, setText } from "../../ui/elements/dom";

const PICTURE_AFTER_MS = 120; // a handle that is being dragged asks for no picture at each event

export interface StretchEvents {
  change(change: Change): void;
  camera(camera: string): void; // another one is to be looked at
}

/** The stretch of an episode with its pictures: to look at it and, for those who may, to trim, split and merge it. */
export class EpisodeStretch {
  readonly element: HTMLElement;
  private readonly boxes: Readonly<Record<Handle, PictureBox>>;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly listed: Listed,
    private readonly camera: string,
    pictures: PictureLoader,
    may: boolean,
    private readonly events: StretchEvents,
  ) {
    const { episode } = listed;
    const trim = button("field-button", "Trim", () => this.trim(track));
    const reset = button("chip-button", "Back to what it was", () => track.reset());
    const split = button("field-button quiet", "", () => this.split(track));
    const follow = (span: Span): void => {
      trim.disabled = reset.disabled = !track.isTrimmed;
      split.disabled = track.isTrimmed || !maySplit(span);
      setText(split, `Split at ${grouped(eventAt(episode, span, "cursor"))}`);
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.showPictures(span), PICTURE_AFTER_MS);
    };
    const track = new SpanTrack(episode, may, follow);
    this.boxes = {
      first: new PictureBox(pictures, "still-end"),
      cursor: new PictureBox(pictures, "still-middle"),
      last: new PictureBox(pictures, "still-end"),
    };
    const stills = h("div", "stills");
    for (const [handle, words] of [
      ["first", "First"],
      ["cursor", "Looked at"],
      ["last", "Last"],
    ] as const) {
      const { element } = this.boxes[handle];
      const caption = h("figcaption", "figure-label", {}, words);
      stills.append(h("figure", `still-figure ${handle}`, {}, element, caption));
    }
    this.element = h(
      "section",
      "editor-part",
      { "aria-label": "Stretch" },
      this.cameras(),
      stills,
      track.element,
    );
    if (may) {
      const tools = h("div", "editor-tools", {}, trim, reset, split);
      const merge = this.merge();
      if (merge !== null) tools.append(merge);
      this.element.append(tools);
    }
    follow(track.value);
    clearTimeout(this.timer);
    this.showPictures(track.value);
  }

  close(): void {
    clearTimeout(this.timer);
    for (const box of Object.values(this.boxes)) box.close();
  }

  private cameras(): HTMLElement {
    const { cameras } = this.listed.recording;
    const element = h("div", "segments editor-cameras", { role: "group", "aria-label": "Camera" });
    element.hidden = cameras.length < 2;
    for (const camera of cameras) {
      const choose = button("segment", camera, () => this.events.camera(camera));
      setPressed(choose, camera === this.camera);
      element.append(choose);
    }
    return element;
  }

  private showPictures(span: Span): void {
    const { recording, episode } = this.listed;
    for (const handle of ["cursor", "first", "last"] as const) {
      const event = eventAt(episode, span, handle);
      const wanted = {
        recording: recording.id,
        camera: this.camera,
        event,
        width: handle === "cursor" ? 640 : 320,
      };
      this.boxes[handle].show(
        this.camera === "" ? null : wanted,
        `Picture of ${this.camera || "no camera"} at event ${event}`,
      );
    }
  }

  private trim(track: SpanTrack): void {
    const { episode } = this.listed;
    this.events.change({
      episode: episode.id,
      first_event: eventAt(episode, track.value, "first"),
      last_event: eventAt(episode, track.value, "last"),
    });
  }

  private split(track: SpanTrack): void {
    const { episode } = this.listed;
    this.events.change({ episode: episode.id, split: eventAt(episode, track.value, "cursor") });
  }

  private merge(): HTMLElement | null {
    const { recording, episode } = this.listed;
    const behind = recording.episodes.find((each) => each.id === episode.mergesWith);
    if (behind === undefined) return null;
    const between = behind.firstEvent - episode.lastEvent;
    const merge = button("field-button quiet", "Merge with the next", () => {
      this.events.change({ episode: episode.id, merge: behind.id });
    });
    const what = `${titleOf(behind)}, take ${behind.number}`;
    merge.title = between > 0 ? `${what}; with the ${between} events between them` : what;
    return merge;
  }
}
