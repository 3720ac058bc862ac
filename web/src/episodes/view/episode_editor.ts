import { keyOf } from "../episode_filter";
import type { Episode, EpisodeChange, Listed, Outcome } from "../episode_list";
import { eventAt, maySplit, type Handle, type Span } from "../episode_span";
import { OUTCOMES, lengthLabel, qualityWords, tagsOf, titleOf } from "../episode_words";
import type { Change } from "../episodes_api";
import type { PictureLoader } from "../picture_loader";
import { PictureBox } from "./picture_box";
import { SpanTrack } from "./span_track";
import { dayLabel } from "../../replay/recording_list";
import { replayHash } from "../../replay/replay_link";
import { button, grouped, h, setHidden, setPressed, setText } from "../../ui/elements/dom";

const PICTURE_AFTER_MS = 120; // a handle that is being dragged asks for no picture at each event

export interface EditorEvents {
  /** Returns what went wrong, in words; "" when it was done. */
  change(listed: Listed, change: Change): Promise<string>;
  step(by: 1 | -1): void;
  report(listed: Listed): Promise<string>;
  closed(): void;
}

/** The dialogue of one episode: to look at it and, for those who may, to change it. */
export class EpisodeEditor {
  readonly element = h("dialog", "editor", { "aria-labelledby": "editor-title" });
  private listed: Listed;
  private camera: string;
  private readonly title = h("h2", "editor-title", { id: "editor-title" });
  private readonly tags = h("span", "editor-tags");
  private readonly about = h("p", "editor-about muted");
  private readonly body = h("div", "editor-body");
  private readonly said = h("p", "editor-said", { role: "alert" });
  private readonly previous = button("chip-button", "Previous", () => this.events.step(-1));
  private readonly following = button("chip-button", "Next", () => this.events.step(1));
  private boxes: Partial<Record<Handle, PictureBox>> = {};
  private timer: ReturnType<typeof setTimeout> | undefined;
  private drawn = "";
  private busy = false;

  constructor(
    listed: Listed,
    private readonly pictures: PictureLoader,
    private readonly token: string,
    private readonly mayEdit: boolean,
    private readonly events: EditorEvents,
  ) {
    this.listed = listed;
    this.camera = listed.recording.cameras[0] ?? "";
    const close = button("sheet-close", "Close", () => this.element.close());
    const head = h(
      "header",
      "editor-head",
      {},
      h("div", "editor-names", {}, h("div", "row-title", {}, this.title, this.tags), this.about),
      h("div", "editor-steps", {}, this.previous, this.following, close),
    );
    this.said.hidden = true;
    this.element.append(head, this.said, this.body);
    this.element.addEventListener("close", () => {
      this.close();
      this.events.closed();
    });
    this.element.addEventListener("click", (event) => {
      if (event.target === this.element) this.element.close(); // beside it
    });
    this.show(listed, false, false);
  }

  get key(): string {
    return keyOf(this.listed);
  }

  get recording(): string {
    return this.listed.recording.id;
  }

  open(): void {
    document.body.append(this.element);
    this.element.showModal();
  }

  close(): void {
    clearTimeout(this.timer);
    for (const box of Object.values(this.boxes)) box.close();
    this.element.remove();
  }

  say(words: string): void {
    setText(this.said, words);
    setHidden(this.said, words === "");
  }

  /** The newest state of this episode, or another episode. */
  show(listed: Listed, hasPrevious: boolean, hasNext: boolean): void {
    const another = keyOf(listed) !== this.key;
    this.listed = listed;
    this.previous.disabled = !hasPrevious;
    this.following.disabled = !hasNext;
    if (another) {
      this.say("");
      if (!listed.recording.cameras.includes(this.camera)) this.camera = listed.recording.cameras[0] ?? "";
    }
    const { recording, episode } = listed;
    const state = JSON.stringify([episode, recording.revision, recording.cameras, recording.changes]);
    if (state === this.drawn) return; // what somebody is about to change stays
    this.drawn = state;
    this.draw();
  }

  private draw(): void {
    const { recording, episode } = this.listed;
    clearTimeout(this.timer);
    for (const box of Object.values(this.boxes)) box.close();
    setText(this.title, titleOf(episode));
    this.tags.replaceChildren(...tagsOf(episode).map(({ text, tone }) => h("span", `tag ${tone}`, {}, text)));
    const words = [
      `Take ${episode.number}`,
      lengthLabel(episode),
      `${grouped(episode.firstEvent)} – ${grouped(episode.lastEvent)}`,
      episode.drivers.join(", ") || "nobody drove",
      dayLabel(episode.started),
      recording.name || recording.id,
      qualityWords(episode),
    ];
    setText(this.about, words.join(" · "));
    const may = this.mayEdit && episode.editable;
    const parts = [this.stretch(may)];
    if (may) parts.push(this.labels());
    parts.push(this.history(), this.links());
    this.body.replaceChildren(...parts);
  }

  // the stretch: pictures, handles, trim, split, merge

  private stretch(may: boolean): HTMLElement {
    const { episode } = this.listed;
    const trim = button("field-button", "Trim", () => void this.trim(track));
    const reset = button("chip-button", "Back to what it was", () => track.reset());
    const split = button("field-button quiet", "", () => void this.split(track));
    const follow = (span: Span): void => {
      trim.disabled = reset.disabled = !track.isTrimmed;
      split.disabled = track.isTrimmed || !maySplit(span);
      setText(split, `Split at ${grouped(eventAt(episode, span, "cursor"))}`);
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.showPictures(span), PICTURE_AFTER_MS);
    };
    const track = new SpanTrack(episode, may, follow);
    this.boxes = {
      first: new PictureBox(this.pictures, "still-end"),
      cursor: new PictureBox(this.pictures, "still-middle"),
      last: new PictureBox(this.pictures, "still-end"),
    };
    const stills = h("div", "stills");
    for (const [handle, words] of [
      ["first", "First"],
      ["cursor", "Looked at"],
      ["last", "Last"],
    ] as const) {
      const box = this.boxes[handle];
      if (box !== undefined)
        stills.append(
          h("figure", `still-figure ${handle}`, {}, box.element, h("figcaption", "figure-label", {}, words)),
        );
    }
    const element = h(
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
      element.append(tools);
    }
    follow(track.value);
    clearTimeout(this.timer);
    this.showPictures(track.value);
    return element;
  }

  private cameras(): HTMLElement {
    const { cameras } = this.listed.recording;
    const element = h("div", "segments editor-cameras", { role: "group", "aria-label": "Camera" });
    element.hidden = cameras.length < 2;
    for (const camera of cameras) {
      const choose = button("segment", camera, () => {
        this.camera = camera;
        this.drawn = "";
        this.show(this.listed, !this.previous.disabled, !this.following.disabled);
      });
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
      this.boxes[handle]?.show(
        this.camera === "" ? null : wanted,
        `Picture of ${this.camera || "no camera"} at event ${event}`,
      );
    }
  }

  private async trim(track: SpanTrack): Promise<void> {
    const { episode } = this.listed;
    await this.do({
      episode: episode.id,
      first_event: eventAt(episode, track.value, "first"),
      last_event: eventAt(episode, track.value, "last"),
    });
  }

  private async split(track: SpanTrack): Promise<void> {
    const { episode } = this.listed;
    await this.do({ episode: episode.id, split: eventAt(episode, track.value, "cursor") });
  }

  private merge(): HTMLElement | null {
    const { recording, episode } = this.listed;
    const behind = recording.episodes.find((each) => each.id === episode.mergesWith);
    if (behind === undefined) return null;
    const between = behind.firstEvent - episode.lastEvent;
    const merge = button("field-button quiet", "Merge with the next", () => {
      void this.do({ episode: episode.id, merge: behind.id });
    });
    const what = `${titleOf(behind)}, take ${behind.number}`;
    merge.title = between > 0 ? `${what}; with the ${between} events between them` : what;
    return merge;
  }

  // task, outcome, discard

  private labels(): HTMLElement {
    const { episode } = this.listed;
    const task = h("input", "field", { maxlength: "300", autocomplete: "off" });
    task.value = episode.task;
    let outcome: Outcome = episode.outcome;
    const save = h("button", "field-button", { type: "submit" }, "Save");
    const follow = (): void => {
      for (const [value, each] of choices) setPressed(each, value === outcome);
      save.disabled = task.value.trim() === episode.task && outcome === episode.outcome;
    };
    const choices = OUTCOMES.map(([value, label]) => {
      const choose = button("segment", label, () => {
        outcome = value;
        follow();
      });
      return [value, choose] as const;
    });
    task.addEventListener("input", follow);
    const label = episode.restorable ? "Restore" : "Discard";
    const drop = button("field-button quiet", label, () => {
      void this.do({ episode: episode.id, dropped: !episode.restorable });
    });
    const form = h(
      "form",
      "editor-labels",
      {},
      h("label", "form-field wide", {}, h("span", "form-label", {}, "Task"), task),
      h(
        "div",
        "form-field",
        {},
        h("span", "form-label", {}, "Outcome"),
        h("div", "segments", { role: "group", "aria-label": "Outcome" }, ...choices.map(([, each]) => each)),
      ),
      h("div", "editor-saves", {}, save, drop),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const words = task.value.trim();
      void this.do({
        episode: episode.id,
        ...(words === episode.task ? {} : { task: words }),
        ...(outcome === episode.outcome ? {} : { outcome }),
      });
    });
    follow();
    return h("section", "editor-part", { "aria-label": "Labels" }, form);
  }

  // what was changed, and where else to look

  private history(): HTMLElement {
    const { recording, episode } = this.listed;
    const mine = recording.changes.filter((each) => concerns(each, episode));
    const element = h("details", "editor-part editor-history", {});
    const count = mine.length === 1 ? "1 change" : `${mine.length} changes`;
    element.append(h("summary", "filter-summary", {}, mine.length === 0 ? "No changes" : count));
    if (recording.trouble !== "") element.append(h("p", "form-trouble", {}, recording.trouble));
    const list = h("ol", "changes");
    for (const each of [...mine].reverse()) list.append(this.changeRow(each));
    element.append(list);
    element.open = mine.length > 0;
    element.hidden = mine.length === 0 && recording.trouble === "";
    return element;
  }

  private changeRow(each: EpisodeChange): HTMLElement {
    const state = each.undone ? " (taken back)" : each.problem === "" ? "" : ` (no effect: ${each.problem})`;
    const who = [each.by, dayLabel(each.at * 1e6)].filter(Boolean).join(", ");
    const row = h(
      "li",
      "change",
      {},
      h("span", "change-words", {}, `${each.number}. ${each.text}${state}`),
      h("span", "muted", {}, who),
    );
    const may = this.mayEdit && !each.undone && each.problem === "" && each.kind !== "undo";
    if (may) {
      const undo = button("chip-button", "Undo", () => void this.do({ undo: each.number }));
      undo.setAttribute("aria-label", `Undo change ${each.number}`);
      row.append(undo);
    }
    return row;
  }

  private links(): HTMLElement {
    const { recording, episode } = this.listed;
    const href = `./recordings${replayHash({ token: this.token, recording: recording.id, event: episode.firstEvent })}`;
    const play = h("a", "chip-button", { href, target: "_blank", rel: "noopener" }, "Open in the player");
    const element = h("div", "editor-links", {}, play);
    if (this.mayEdit && !recording.running)
      element.append(button("chip-button", "Report of this recording", () => void this.makeReport()));
    return element;
  }

  private async makeReport(): Promise<void> {
    this.say("Making the report …");
    this.say(await this.events.report(this.listed));
  }

  private async do(change: Change): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    this.element.setAttribute("aria-busy", "true");
    const { key } = this;
    const words = await this.events.change(this.listed, change);
    this.busy = false;
    this.element.removeAttribute("aria-busy");
    if (words !== "" || key === this.key) this.say(words);
  }
}

function concerns(change: EpisodeChange, episode: Episode): boolean {
  const made = /^edit-(\d+)/.exec(episode.id)?.[1];
  return (
    change.episode === episode.id || episode.madeOf.includes(change.episode) || String(change.number) === made
  );
}
