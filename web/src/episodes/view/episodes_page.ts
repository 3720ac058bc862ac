import { allOf, filtered, isFiltering, keyOf } from "../episode_filter";
import type { Listed, RecordingEpisodes } from "../episode_list";
import { EpisodePoll } from "../episode_poll";
import { summaryWords, titleOf } from "../episode_words";
import type { Change, EpisodesApi } from "../episodes_api";
import { PictureLoader } from "../picture_loader";
import { EpisodeEditor } from "./episode_editor";
import { EpisodeRows } from "./episode_rows";
import { FilterBar } from "./filter_bar";
import { emptyWords, readingWords, troubleWords } from "./list_words";
import { UndoBar } from "./undo_bar";
import { saveReport } from "../../replay/view/save_report";
import { ConsoleError } from "../../transport/signalling/console_api";
import { requestErrorLabel } from "../../transport/signalling/session_api";
import { button, grouped, h, setHidden, setText } from "../../ui/elements/dom";
import { roleOf } from "../../util/url_fragment";

const STEP = 100; // rows that are drawn at once

/** The list of the episodes of all recordings. */
export class EpisodesPage {
  readonly element = h("main", "library episodes");
  private readonly poll: EpisodePoll;
  private readonly pictures: PictureLoader;
  private readonly bar: FilterBar;
  private readonly rows: EpisodeRows;
  private readonly count = h("span", "muted library-count", { role: "status" });
  private readonly note = h("div", "library-note");
  private readonly noteWords = h("p", "", { role: "status" });
  private readonly clear = button("chip-button", "Show all", () => {
    this.bar.clear();
    this.draw();
  });
  private readonly reading = h("p", "episodes-reading muted", { role: "status" });
  private readonly trouble = h("p", "library-trouble", { role: "alert" });
  private readonly more = button("chip-button", "", () => {
    this.limit += STEP;
    this.draw();
  });
  private readonly older = button("chip-button", "", () => void this.poll.askOlder());
  private readonly undo = new UndoBar(() => void this.undoLast());
  private readonly mayEdit: boolean;
  private shown: readonly Listed[] = [];
  private limit = STEP;
  private editor: EpisodeEditor | null = null;
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
    this.rows = new EpisodeRows(this.pictures, this.mayEdit, {
      open: (each) => this.open(each),
      drop: (each, dropped) => void this.dropFromList(each, dropped),
    });
    this.note.append(this.noteWords, this.clear);
    const head = h("header", "library-head", {}, h("h1", "library-title", {}, "Episodes"), this.count);
    const tail = h("div", "library-tail", {}, this.more, this.older);
    this.element.append(
      head,
      this.bar.element,
      this.trouble,
      this.reading,
      this.note,
      this.rows.element,
      tail,
      this.undo.element,
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
    this.rows.close();
    this.editor?.element.close();
    this.pictures.close();
  }

  // the list

  private draw(): void {
    const { state } = this.poll;
    const { recordings, older } = state;
    const all = allOf(recordings ?? []);
    this.bar.update(all);
    const { filter } = this.bar;
    this.shown = filtered(all, filter);
    setText(this.count, all.length === 0 ? "" : summaryWords(this.shown, all.length));
    const words = emptyWords(state, this.shown.length, all.length);
    setText(this.noteWords, words);
    setHidden(this.note, words === "");
    setHidden(this.clear, !isFiltering(filter) || all.length === 0);
    setText(this.reading, readingWords(state));
    setHidden(this.reading, this.reading.textContent === "");
    const told = [troubleWords(state, performance.now()), this.said ?? ""].filter(Boolean).join(" ");
    setText(this.trouble, told);
    setHidden(this.trouble, told === "");
    this.rows.place(this.shown.slice(0, this.limit));
    const rest = this.shown.length - this.limit;
    setHidden(this.more, rest <= 0);
    setText(this.more, `Show ${Math.min(rest, STEP)} more of ${grouped(this.shown.length)}`);
    setHidden(this.older, older === 0);
    setText(this.older, `Look at older recordings (${grouped(older)} more)`);
    this.showEditor(recordings ?? []);
  }

  // the dialogue

  private open(listed: Listed): void {
    this.editor = new EpisodeEditor(listed, this.pictures, this.token, this.mayEdit, {
      change: (each, change) => this.change(each, change),
      step: (by) => this.step(by),
      report: (each) => saved(this.api, each),
      closed: () => this.closedEditor(),
    });
    this.editor.open();
    this.draw();
  }

  private closedEditor(): void {
    const key = this.editor?.key;
    this.editor = null;
    if (key !== undefined) this.rows.focus(key);
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
    const { last } = this.undo;
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
      this.undo.offer(found, change, titleOf(episode));
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
}

/** Saves the report of a recording. Returns what went wrong, in words; "" when it was done. */
async function saved(api: EpisodesApi, { recording }: Listed): Promise<string> {
  try {
    saveReport(recording.id, await api.report(recording.id));
    return "";
  } catch (error) {
    return requestErrorLabel(error);
  }
}
