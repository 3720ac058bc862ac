import { keyOf } from "../episode_filter";
import type { Listed } from "../episode_list";
import { lengthLabel, qualityWords, tagsOf, titleOf } from "../episode_words";
import type { Change } from "../episodes_api";
import type { PictureLoader } from "../picture_loader";
import { changeHistory } from "./change_history";
import { EpisodeStretch } from "./episode_stretch";
import { labelsForm } from "./labels_form";
import { dayLabel } from "../../replay/recording_list";
import { replayHash } from "../../replay/replay_link";
import { button, grouped, h, setHidden, setText } from "../../ui/elements/dom";

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
  private stretch: EpisodeStretch | null = null;
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
    this.stretch?.close();
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
    this.stretch?.close();
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
    const change = (wanted: Change): void => void this.do(wanted);
    this.stretch = new EpisodeStretch(this.listed, this.camera, this.pictures, may, {
      change,
      camera: (camera) => {
        this.camera = camera;
        this.drawn = "";
        this.show(this.listed, !this.previous.disabled, !this.following.disabled);
      },
    });
    const parts = [this.stretch.element];
    if (may) parts.push(labelsForm(episode, change));
    parts.push(
      changeHistory(this.listed, this.mayEdit, (undo) => change({ undo })),
      this.links(),
    );
    this.body.replaceChildren(...parts);
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
