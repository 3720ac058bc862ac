import type { TraceBook } from "../engine/trace_book";
import { h } from "../ui/elements/dom";
import { WayFigure } from "./way_figure";
import { commandSummary, pictureSummary } from "./way_summary";

/** Whose ways are shown, and what can be known of them. */
export interface WaySource {
  readonly book: TraceBook;
  mainStream(): string | null;
  mayDrive(): boolean;
  isRelayed(): boolean; // pictures come through a relay, of which the console knows nothing
}

const EMPTY_RELAYED = "Pictures come through a relay: only the console could say where their time goes.";
const EMPTY_PICTURE = "No picture was traced in this time.";
const EMPTY_COMMAND =
  "Drive: each command is traced from the stick to the robot and back, also for two minutes after the charts were closed.";
const EMPTY_WATCHING = "This link watches: commands are traced at the page that drives.";
const NO_REMAINDER = "the network shows while you drive";

/** The picture's way and the command's, one below the other. */
export class WayFigures {
  readonly element = h("div", "ways");
  private readonly picture = new WayFigure("Picture's way", "picture_way", "from capture to canvas");
  private readonly command = new WayFigure("Command's way", "command_way", "from stick to feedback");

  constructor(private readonly source: WaySource) {
    this.element.append(this.picture.element, this.command.element);
  }

  /** From `from` to `until`, s since 1970. */
  show(from: number, until: number): void {
    const { source } = this;
    const [fromMs, untilMs] = [from * 1000 - performance.timeOrigin, until * 1000 - performance.timeOrigin];
    const stream = source.mainStream();
    const picture = stream === null ? null : pictureSummary(source.book, stream, fromMs, untilMs);
    const note = picture !== null && !picture.hasRemainder && source.mayDrive() ? NO_REMAINDER : "";
    this.picture.show(picture, source.isRelayed() ? EMPTY_RELAYED : EMPTY_PICTURE, note);
    const command = commandSummary(source.book, fromMs, untilMs);
    this.command.show(command, source.mayDrive() ? EMPTY_COMMAND : EMPTY_WATCHING, "");
  }
}
