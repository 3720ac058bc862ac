import type { Listed } from "../episode_list";
import { middleOf } from "../episode_span";
import { hasProblems, lengthLabel, qualityWords, tagsOf, titleOf } from "../episode_words";
import type { PictureLoader } from "../picture_loader";
import { PictureBox } from "./picture_box";
import { dayLabel } from "../../replay/recording_list";
import { button, grouped, h, setData } from "../../ui/elements/dom";

export interface RowEvents {
  open(listed: Listed): void;
  drop(listed: Listed, dropped: boolean): void;
}

/** One episode in the list. */
export class EpisodeRow {
  readonly element = h("li", "episode-row");
  private readonly picture: PictureBox;
  private readonly main = h("button", "episode-open", { type: "button" });
  private readonly figures = h("dl", "episode-figures");
  private readonly tools = h("div", "episode-tools");
  private drawn = "";
  private isSeen = false;
  private listed: Listed;

  constructor(
    listed: Listed,
    pictures: PictureLoader,
    private readonly mayEdit: boolean,
    private readonly events: RowEvents,
  ) {
    this.listed = listed;
    this.picture = new PictureBox(pictures, "episode-picture");
    this.main.addEventListener("click", () => this.events.open(this.listed));
    this.element.append(this.main, this.figures, this.tools);
    this.show(listed);
  }

  show(listed: Listed): void {
    this.listed = listed;
    const { recording, episode } = listed;
    const { id, name, running, cameras } = recording;
    const state = JSON.stringify([episode, id, name, running, cameras[0]]);
    if (state !== this.drawn) {
      this.drawn = state;
      this.draw();
    }
    this.showPicture();
  }

  /** Whether it is on the screen: only then it has a picture. */
  seen(isSeen: boolean): void {
    this.isSeen = isSeen;
    if (isSeen) this.showPicture();
    else this.picture.rest();
  }

  focus(): void {
    this.main.focus();
  }

  close(): void {
    this.picture.close();
  }

  private showPicture(): void {
    if (!this.isSeen) return;
    const { recording, episode } = this.listed;
    const camera = recording.cameras[0];
    const event = middleOf(episode);
    this.picture.show(
      camera === undefined ? null : { recording: recording.id, camera, event, width: 160 },
      "",
    );
  }

  private draw(): void {
    const { recording, episode } = this.listed;
    setData(this.element, "state", episode.state);
    const tags = tagsOf(episode).map(({ text, tone }) => h("span", `tag ${tone}`, {}, text));
    const where = [
      episode.drivers.join(", ") || "nobody drove",
      dayLabel(episode.started),
      recording.name || recording.id,
    ];
    const take = episode.madeOf.length > 1 ? "merged" : `take ${episode.number}`;
    const part = episode.madeOf.length === 1 ? `part of take ${episode.number}` : take;
    this.main.replaceChildren(
      this.picture.element,
      h(
        "span",
        "episode-about",
        {},
        h("span", "row-title", {}, h("span", "episode-task", {}, titleOf(episode)), ...tags),
        h("span", "row-about", {}, where.join(" · ")),
        h(
          "span",
          hasProblems(episode) ? "episode-quality bad" : "episode-quality",
          {},
          qualityWords(episode),
        ),
      ),
    );
    this.figures.replaceChildren(
      figure("Length", episode.state === "open" ? "–" : lengthLabel(episode)),
      figure("Events", grouped(episode.events)),
      figure("Take", part.replace(/^take /, "")),
    );
    this.tools.replaceChildren(...this.toolsOf());
  }

  private toolsOf(): HTMLElement[] {
    const { episode } = this.listed;
    if (!this.mayEdit || !episode.editable) return [];
    const label = episode.restorable ? "Restore" : "Discard";
    const drop = button("chip-button", label, () => this.events.drop(this.listed, !episode.restorable));
    drop.setAttribute("aria-label", `${label}: ${titleOf(episode)}, take ${episode.number}`);
    return [drop];
  }
}

function figure(label: string, value: string): HTMLElement {
  return h("div", "row-figure", {}, h("dt", "figure-label", {}, label), h("dd", "", {}, value));
}
