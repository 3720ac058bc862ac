import { allOf, filtered, isFiltering, keyOf } from "../episode_filter";
import type { Listed, RecordingEpisodes } from "../episode_list";
import { EpisodePoll } from "../episode_poll";
import { summaryWords, titleOf } from "../episode_words";
import type { Change, EpisodesApi } from "../episodes_api";
import { PictureLoader } from "../picture_loader";
import { EpisodeEditor } from "./episode_editor";
import { EpisodeRow } from "./episode_row";
import { FilterBar } from "./filter_bar";
import { saveReport } from "../../replay/view/save_report";
import { ConsoleError } from "../../transport/signalling/console_api";
import { requestErrorLabel } from "../../transport/signalling/session_api";
import { button, grouped, h, setHidden, setText } from "../../ui/elements/dom";
import { roleOf } from "../../util/url_fragment";

const STEP = 100; // rows that are drawn at once
const MARGIN = "200px"; // around the screen, where pictures are loaded already

/** The list of the episodes of all recordings. */
export class EpisodesPage {
  readonly element = h("main", "library episodes");
  private readonly poll: EpisodePoll;
  private readonly pictures: PictureLoader;
  private readonly bar: FilterBar;
  private readonly rows = new Map<string, EpisodeRow>();
  private readonly list = h("ol", "library-rows episode-rows", { "aria-label": "Episodes" });
  private readonly count = h("span", "muted library-count", { role: "status" });
  private readonly note = h("div", "library-note");
  private readonly noteWords = h("p", "", { role: "status" });
  private readonly clear = button("chip-button", "Show all", () => this.clearFilter());
  private readonly reading = h("p", "episodes-reading muted", { role: "status" });
  private readonly trouble = h("p", "library-trouble", { role: "alert" });
  private readonly more = button("chip-button", "", () => this.showMore());
  private readonly older = button("chip-button", "", () => void this.poll.askOlder());
  private readonly undoWords = h("span", "undo-words", { role: "status" });
  private readonly undo = button("chip-button", "Undo", () => void this.undoLast());
  private readonly undoBar = h("div", "undo-bar", {}, this.undoWords, this.undo);
  private readonly watcher: IntersectionObserver;
  private readonly mayEdit: boolean;
  private shown: readonly Listed[] = [];
  private limit = STEP;
  private editor: EpisodeEditor | null = null;
  private last: { readonly recording: string; readonly number: number } | null = null;
  private said: string | null = null; // why something was not done
  private readonly onVisible = (): void => {
    if (!document.hidden) this.poll.hurry();
  };

  constructor(
    private readonly api: EpisodesApi,
    private readonly token: string,
    recording: string,
  ) {
    const role = roleOf(token);
    this.mayEdit = role === "operator" || role === "supervisor";
    this.pictures = new PictureLoader(({ recording: id, camera, event, width }) =>
      this.api.picture(id, camera, event, width),
    );
    this.bar = new FilterBar(recording, () => {
      this.limit = STEP;
      this.draw();
    });
    this.watcher = new IntersectionObserver((entries) => this.seen(entries), {
      root: null,
      rootMargin: MARGIN,
    });
    this.note.append(this.noteWords, this.clear);
    const head = h("header", "library-head", {}, h("h1", "library-title", {}, "Episodes"), this.count);
    const tail = h("div", "library-tail", {}, this.more, this.older);
    this.undoBar.hidden = true;
    this.element.append(
      head,
      this.bar.element,
      this.trouble,
      this.reading,
      this.note,
      this.list,
      tail,
      this.undoBar,
    );
    this.poll = new EpisodePoll(
      api,
      () => this.draw(),
      () => !document.hidden,
    );
    document.addEventListener("visibilitychange", this.onVisible);
    this.draw();
    this.poll.start();
  }

  close(): void {
    document.removeEventListener("visibilitychange", this.onVisible);
    this.poll.close();
    this.watcher.disconnect();
    for (const row of this.rows.values()) row.close();
    this.editor?.element.close();
    this.pictures.close();
  }

  // the list

  private draw(): void {
    const { recordings, older, pending, unreadable, trouble } = this.poll.state;
    const all = allOf(recordings ?? []);
    this.bar.update(all);
    const { filter } = this.bar;
    this.shown = filtered(all, filter);
    setText(this.count, all.length === 0 ? "" : summaryWords(this.shown, all.length));
    const words = this.emptyWords(recordings, all.length);
    setText(this.noteWords, words);
    setHidden(this.note, words === "");
    setHidden(this.clear, !isFiltering(filter) || all.length === 0);
    setText(this.reading, readingWords(pending, unreadable));
    setHidden(this.reading, this.reading.textContent === "");
    this.sayTrouble(trouble);
    this.place(this.shown.slice(0, this.limit));
    const rest = this.shown.length - this.limit;
    setHidden(this.more, rest <= 0);
    setText(this.more, `Show ${Math.min(rest, STEP)} more of ${grouped(this.shown.length)}`);
    setHidden(this.older, older === 0);
    setText(this.older, `Look at older recordings (${grouped(older)} more)`);
    this.showEditor(recordings ?? []);
  }

  private emptyWords(recordings: readonly RecordingEpisodes[] | null, all: number): string {
    if (recordings === null) return this.poll.state.trouble === null ? "Loading the episodes …" : "";
    if (this.shown.length > 0) return "";
    if (all > 0) return "No episode is like this.";
    if (this.poll.state.pending > 0) return "Loading the episodes …";
    return "There are no episodes yet. Record on the console’s page, then begin one in the bar under the control seat.";
  }

  private sayTrouble(error: unknown): void {
    const words = error === null ? "" : `${requestErrorLabel(error)}${this.asOf()}`;
    const told = [words, this.said ?? ""].filter(Boolean).join(" ");
    setText(this.trouble, told);
    setHidden(this.trouble, told === "");
  }

  private asOf(): string {
    const { recordings, asOf } = this.poll.state;
    if (recordings === null) return "";
    const seconds = Math.round((performance.now() - asOf) / 1000);
    return ` What is shown is ${seconds < 90 ? `${seconds} s` : `${Math.round(seconds / 60)} min`} old.`;
  }

  /** Rows that stay are not touched, so that what is focused stays so. */
  private place(listed: readonly Listed[]): void {
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
      const place: Element | null = before === null ? this.list.firstElementChild : before.nextElementSibling;
      if (place !== row.element) this.list.insertBefore(row.element, place);
      before = row.element;
    }
  }

  private rowOf(listed: Listed): EpisodeRow {
    const key = keyOf(listed);
    const known = this.rows.get(key);
    if (known !== undefined) {
      known.show(listed);
      return known;
    }
    const row = new EpisodeRow(listed, this.pictures, this.mayEdit, {
      open: (each) => this.open(each),
      drop: (each, dropped) => void this.dropFromList(each, dropped),
    });
    row.element.dataset["key"] = key;
    this.rows.set(key, row);
    this.watcher.observe(row.element);
    return row;
  }

  private seen(entries: readonly IntersectionObserverEntry[]): void {
    for (const { target, isIntersecting } of entries)
      this.rows.get((target as HTMLElement).dataset["key"] ?? "")?.seen(isIntersecting);
  }

  private showMore(): void {
    this.limit += STEP;
    this.draw();
  }

  private clearFilter(): void {
    this.bar.clear();
    this.draw();
  }

  // the dialogue

  private open(listed: Listed): void {
    this.editor = new EpisodeEditor(listed, this.pictures, this.token, this.mayEdit, {
      change: (each, change) => this.change(each, change),
      step: (by) => this.step(by),
      report: (each) => this.report(each),
      closed: () => this.closedEditor(),
    });
    this.editor.open();
    this.draw();
  }

  private closedEditor(): void {
    const key = this.editor?.key;
    this.editor = null;
    if (key !== undefined) this.rows.get(key)?.focus();
  }

  private placeOf(key: string): number {
    return this.shown.findIndex((each) => keyOf(each) === key);
  }

  private step(by: 1 | -1): void {
    const { editor } = this;
    if (editor === null) return;
    const next = this.shown[this.placeOf(editor.key) + by];
    if (next !== undefined) this.showIn(editor, next);
  }

  private showEditor(recordings: readonly RecordingEpisodes[]): void {
    const { editor } = this;
    if (editor === null) return;
    const recording = recordings.find((each) => each.id === editor.recording);
    const episode = recording?.episodes.find((each) => keyOf({ recording, episode: each }) === editor.key);
    if (recording !== undefined && episode !== undefined) this.showIn(editor, { recording, episode });
  }

  private showIn(editor: EpisodeEditor, listed: Listed): void {
    const at = this.placeOf(keyOf(listed));
    editor.show(listed, at > 0, at !== -1 && at + 1 < this.shown.length);
  }

  // changes

  private async dropFromList(listed: Listed, dropped: boolean): Promise<void> {
    const words = await this.change(listed, { episode: listed.episode.id, dropped });
    this.said = words === "" ? null : words;
    this.draw();
  }

  private async undoLast(): Promise<void> {
    const { last } = this;
    const recording = this.poll.state.recordings?.find((each) => each.id === last?.recording);
    const episode = recording?.episodes[0];
    if (last === null || recording === undefined || episode === undefined) return;
    const words = await this.change({ recording, episode }, { undo: last.number });
    this.said = words === "" ? null : words;
    this.draw();
  }

  /** Returns what went wrong, in words; "" when it was done. */
  private async change({ recording, episode }: Listed, change: Change): Promise<string> {
    const newest = this.poll.state.recordings?.find((each) => each.id === recording.id) ?? recording;
    // A change is made of what its author has seen, not of what came since.
    const revision = "undo" in change ? newest.revision : recording.revision;
    try {
      const found = await this.api.change(recording.id, revision, change);
      this.offerUndo(found, change, titleOf(episode));
      this.poll.put(found);
      this.follow(found, change);
      return "";
    } catch (error) {
      if (error instanceof ConsoleError && error.error === "stale_edit") {
        await this.reload(recording.id);
        return "Somebody else has changed the episodes of this recording meanwhile. Look again, then repeat it.";
      }
      return requestErrorLabel(error);
    }
  }

  private async reload(id: string): Promise<void> {
    try {
      this.poll.put(await this.api.recording(id));
    } catch {
      this.poll.hurry();
    }
  }

  private offerUndo(found: RecordingEpisodes, change: Change, title: string): void {
    this.last = "undo" in change ? null : { recording: found.id, number: found.revision };
    setText(this.undoWords, `${doneWords(change)}: ${title}`);
    setHidden(this.undo, this.last === null);
    setHidden(this.undoBar, false);
  }

  /** The dialogue goes on with what its episode has become. */
  private follow(recording: RecordingEpisodes, change: Change): void {
    const { editor } = this;
    if (editor === null) return;
    const still = recording.episodes.some((each) => keyOf({ recording, episode: each }) === editor.key);
    if (still) return;
    const made = `edit-${recording.revision}`;
    const before = "undo" in change ? undefined : change.episode;
    const next =
      recording.episodes.find((each) => each.id === made || each.id === `${made}a`) ??
      recording.episodes.find((each) => each.id === before);
    if (next === undefined) editor.element.close();
    else this.showIn(editor, { recording, episode: next });
  }

  private async report({ recording }: Listed): Promise<string> {
    try {
      saveReport(recording.id, await this.api.report(recording.id));
      return "";
    } catch (error) {
      return requestErrorLabel(error);
    }
  }
}

function readingWords(pending: number, unreadable: number): string {
  const words = [];
  if (pending > 0) words.push(`Reading ${grouped(pending)} more recordings …`);
  if (unreadable > 0)
    words.push(unreadable === 1 ? "1 file cannot be read." : `${grouped(unreadable)} files cannot be read.`);
  return words.join(" ");
}

function doneWords(change: Change): string {
  if ("undo" in change) return `Change ${change.undo} is taken back`;
  if ("dropped" in change) return change.dropped ? "Discarded" : "Restored";
  if ("split" in change) return "Split";
  if ("merge" in change) return "Merged";
  return "first_event" in change ? "Trimmed" : "Saved";
}
