import type { FleetRobot } from "../fleet_status";
import { episodesPage, robotPage } from "../robot_pages";
import { gapLabel, pictureLabel } from "../tile_labels";
import type { TileState } from "../tile_state";
import { grouped, h, setData, setHidden, setText } from "../../ui/elements/dom";
import type { Thumbnail } from "./thumbnail";
import { createTileIcon } from "./tile_icon";

/** One robot in the overview. Lives as long as the console tells of the robot. */
export class Tile {
  readonly canvas = h("canvas", "picture", { role: "img", width: "320", height: "240" });
  readonly element: HTMLLIElement;
  robot: FleetRobot | null = null;
  state: TileState | null = null;
  thumbnail: Thumbnail | null = null; // the live picture; null: it has none
  instead: string | null = ""; // why it has none; null while it has one
  pictureSays: string | null = null; // why its picture is not live
  private readonly label = h("span", "tile-label");
  private readonly recording = h("span", "tile-recording", {}, "Rec");
  private readonly veil = h("div", "veil");
  private readonly veilWords = h("strong", "veil-words");
  private readonly pictureGap = h("span", "tile-gap");
  private readonly icon = createTileIcon();
  private readonly stateWords = h("span", "tile-words");
  private readonly stateMore = h("span", "tile-more");
  private readonly figures = {
    gap: createFigure("Driver’s gap"),
    event: createFigure("Event"),
    rate: createFigure("Events/s"),
    people: createFigure("People"),
  };
  private readonly openHow = h("span", "tile-open-how");
  private readonly episodes = h("a", "tile-episodes", { target: "_blank", rel: "noopener" }, "Episodes");
  private readonly link = h("a", "tile-open", {}, "Open", this.openHow);
  private isPointedAt = false;

  constructor(readonly name: string) {
    const id = `robot-${name}`;
    const title = h("h2", "tile-name", { id }, name);
    this.veil.append(h("div", "veil-plate", {}, this.veilWords));
    this.canvas.setAttribute("aria-label", `Live picture of ${name}`);
    this.recording.setAttribute("title", "This robot’s session is recorded");
    const body = h(
      "article",
      "tile",
      { "aria-labelledby": id },
      h("header", "tile-head", {}, title, this.label, this.recording),
      h("div", "tile-picture", {}, this.canvas, this.veil, this.pictureGap),
      h(
        "div",
        "tile-state",
        {},
        this.icon.element,
        h("p", "tile-says", {}, this.stateWords, this.stateMore),
        this.episodes,
        this.link,
      ),
      h("dl", "tile-figures", {}, ...Object.values(this.figures).map((figure) => figure.element)),
    );
    this.element = h("li", "tile-place", { "data-robot": name }, body);
    this.element.addEventListener("pointerenter", () => (this.isPointedAt = true));
    this.element.addEventListener("pointerleave", () => (this.isPointedAt = false));
    this.showPicture(performance.now());
  }

  /** Whether somebody points at it, or has the keyboard there. */
  hasAttention(): boolean {
    return this.isPointedAt || this.element.contains(document.activeElement);
  }

  /** What the console told last. */
  show(robot: FleetRobot, state: TileState): void {
    this.robot = robot;
    this.state = state;
    setData(this.element, "kind", state.kind);
    setData(this.element, "tone", state.tone);
    setText(this.label, robot.label === robot.name ? "" : robot.label);
    setHidden(this.recording, !robot.recording || state.kind === "unknown");
    this.icon.show(state.kind);
    setText(this.stateWords, state.words);
    setText(this.stateMore, state.more);
    setHidden(this.stateMore, state.more === "");
    if (this.stateMore.title !== state.more) this.stateMore.title = state.more;
    this.showFigures(robot);
    this.showLink(robot);
  }

  /** The picture and its veil, as they are now. */
  showPicture(now: number): void {
    const video = this.thumbnail?.video ?? null;
    const words = pictureLabel(this.state?.kind ?? null, this.instead, this.thumbnail?.veil(now) ?? null);
    const wasDrawn = (video?.lastDrawnMs ?? null) !== null;
    setData(this.element, "picture", words === null ? "live" : wasDrawn ? "stale" : "none");
    this.pictureSays = words;
    setHidden(this.veil, words === null);
    if (words !== null) setText(this.veilWords, words);
    const gap = video?.gapOnScreen() ?? null;
    setHidden(this.pictureGap, words !== null || gap === null);
    if (gap !== null) setText(this.pictureGap, `gap ${gapLabel(gap, this.thumbnail?.tolerance ?? null)}`);
  }

  private showFigures(robot: FleetRobot): void {
    const { gap, event, rate, people } = this.figures;
    gap.show(gapLabel(robot.gap, robot.tolerance));
    event.show(robot.event === 0 ? "–" : grouped(robot.event));
    rate.show(robot.eventRate.toFixed(robot.eventRate < 9.95 ? 1 : 0));
    people.show(`${robot.peopleCount}`, robot.people.join(", "));
  }

  private showLink(robot: FleetRobot): void {
    const href = robotPage(robot.url, location.hash, document.baseURI);
    const how = robot.mayDrive ? " to drive" : " to watch";
    setText(this.openHow, how);
    if (this.link.ariaLabel !== `Open${how}: ${robot.name}`)
      this.link.ariaLabel = `Open${how}: ${robot.name}`;
    const episodes = episodesPage(robot.url, location.hash, document.baseURI);
    setHidden(this.episodes, episodes === null);
    if (episodes !== null && this.episodes.getAttribute("href") !== episodes) {
      this.episodes.setAttribute("href", episodes);
      this.episodes.ariaLabel = `Episodes of ${robot.name}`;
    }
    if (href === null) this.link.removeAttribute("href");
    else if (this.link.getAttribute("href") !== href) this.link.setAttribute("href", href);
  }
}

interface Figure {
  readonly element: HTMLElement;
  show(text: string, title?: string): void;
}

function createFigure(label: string): Figure {
  const value = h("dd");
  const element = h("div", "tile-figure", {}, h("dt", "", {}, label), value);
  return {
    element,
    show(text, title = "") {
      setText(value, text);
      if (element.title !== title) element.title = title;
    },
  };
}
