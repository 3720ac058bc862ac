import { roleOf } from "../../util/url_fragment";
import { elapsed } from "../../session/recording_labels";
import {
  dayLabel,
  joined,
  searched,
  sizeLabel,
  type RecordingEntry,
  type RecordingList,
} from "../recording_list";
import { requestErrorLabel } from "../../transport/signalling/session_api";
import { replayHash } from "../replay_link";
import { saveReport } from "./save_report";
import { button, grouped, h, setHidden, setText } from "../../ui/elements/dom";
import type { RecordingsApi } from "../recordings_api";

const REFRESH_MS = 5000;

export interface ListEvents {
  open(entry: RecordingEntry): void;
}

/** All recordings: to search, to open, to download, to delete. */
export class ListView {
  readonly element = h("main", "library");
  private newest: RecordingList | null = null;
  private beyond: RecordingList | null = null; // those behind the newest, as far as somebody asked for them
  private readonly search = h("input", "field library-search", {
    type: "search",
    placeholder: "Search by name, robot, person or day",
    "aria-label": "Search recordings",
  });
  private readonly rows = h("div", "library-rows", { role: "list" });
  private readonly note = h("p", "library-note", { role: "status" });
  private readonly count = h("span", "muted");
  private readonly older = button("chip-button", "", () => void this.askOlder());
  private readonly trouble = h("p", "library-trouble", { role: "alert" });
  private reports = ""; // what is being made
  private asked: string | null = null; // id of the one that is about to be deleted
  private readonly role: unknown;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private closed = false;
  private drawn = "";

  constructor(
    private readonly api: RecordingsApi,
    private readonly token: string,
    private readonly events: ListEvents,
  ) {
    this.role = roleOf(token);
    this.search.addEventListener("input", () => this.draw());
    const head = h(
      "header",
      "library-head",
      {},
      h("h1", "library-title", {}, "Recordings"),
      this.count,
      this.search,
    );
    this.element.append(head, this.trouble, this.note, this.rows, this.older);
    this.trouble.hidden = true;
    this.draw();
    void this.refresh();
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
  }

  private async refresh(): Promise<void> {
    try {
      const newest = await this.api.list();
      if (this.beyond !== null) this.beyond = this.shown; // with what the newest have pushed out
      this.newest = newest;
      this.say(null);
    } catch (error) {
      this.say(error);
    }
    if (this.closed) return;
    this.draw();
    this.timer = setTimeout(() => void this.refresh(), REFRESH_MS);
  }

  private get shown(): RecordingList | null {
    return this.newest === null ? null : joined(this.newest, this.beyond);
  }

  private async askOlder(): Promise<void> {
    const last = this.shown?.recordings.at(-1);
    if (last === undefined) return;
    try {
      const more = await this.api.list(last.started);
      this.beyond = {
        recordings: [...(this.beyond?.recordings ?? []), ...more.recordings],
        older: more.older,
      };
      this.say(null);
    } catch (error) {
      this.say(error);
    }
    this.draw();
  }

  private say(error: unknown): void {
    setHidden(this.trouble, error === null);
    setText(this.trouble, error === null ? "" : requestErrorLabel(error));
  }

  private draw(): void {
    const { shown } = this;
    const entries = shown?.recordings ?? null;
    const found = searched(entries ?? [], this.search.value);
    setText(
      this.count,
      entries === null || entries.length === 0 ? "" : countWords(found.length, entries.length),
    );
    setText(this.note, this.noteWords(entries, found.length));
    setHidden(this.older, (shown?.older ?? 0) === 0);
    setText(this.older, `Show older ones (${grouped(shown?.older ?? 0)} more)`);
    setHidden(this.note, this.note.textContent === "");
    const state = JSON.stringify([found.map((each) => [each, [...each.marks]]), this.asked]);
    if (state === this.drawn) return; // what is focused stays so
    this.drawn = state;
    this.rows.replaceChildren(...found.map((entry) => this.row(entry)));
  }

  private noteWords(entries: readonly RecordingEntry[] | null, found: number): string {
    if (this.reports !== "") return this.reports;
    if (entries === null) return this.trouble.hidden ? "Loading the recordings …" : "";
    if (entries.length === 0)
      return "Nothing has been recorded yet. Press Record on the console's page, or start the console with lockstep up --record.";
    return found === 0 ? "No recording has all of these words." : "";
  }

  private row(entry: RecordingEntry): HTMLElement {
    const open = button("row-open", "", () => this.events.open(entry));
    const title = entry.name === "" ? entry.robot || entry.id : entry.name;
    const tags = [
      ...(entry.running ? [h("span", "tag live", {}, "Recording now")] : []),
      ...(entry.interrupted ? [h("span", "tag", {}, "Interrupted")] : []),
      ...(entry.part > 1 ? [h("span", "tag", {}, `Part ${entry.part}`)] : []),
      ...(entry.lost > 0 ? [h("span", "tag bad", {}, `${grouped(entry.lost)} records missing`)] : []),
    ];
    const about = [
      dayLabel(entry.started),
      entry.name === "" ? "" : entry.robot,
      entry.by === "" ? "" : `by ${entry.by}`,
    ];
    open.append(
      h("span", "row-title", {}, title, ...tags),
      h("span", "row-about", {}, about.filter(Boolean).join(" · ")),
      h("span", "row-marks", {}, marksOf(entry)),
    );
    const figures = h(
      "div",
      "row-figures",
      {},
      figure("Length", elapsed((entry.ended - entry.started) / 1e6)),
      figure(
        "Events",
        entry.lastEvent === 0 ? "–" : `${grouped(entry.firstEvent)} – ${grouped(entry.lastEvent)}`,
      ),
      figure("Size", sizeLabel(entry.bytes)),
    );
    const tools = h("div", "row-tools", {}, ...this.tools(entry));
    return h("div", "row", { role: "listitem", "data-recording": entry.id }, open, figures, tools);
  }

  private tools(entry: RecordingEntry): HTMLElement[] {
    if (this.asked === entry.id)
      return [
        h("span", "row-question", {}, "Delete this recording for good?"),
        button("chip-button danger", "Delete", () => void this.delete(entry)),
        button("chip-button", "Keep", () => this.ask(null)),
      ];
    const tools = [];
    if (entry.episodes.size > 0) {
      const href = `./episodes${replayHash({ token: this.token, recording: entry.id, event: null })}`;
      tools.push(h("a", "chip-button", { href }, "Episodes"));
    }
    if (mayDownload(this.role) && !entry.running)
      tools.push(button("chip-button", "Report", () => void this.report(entry)));
    if (mayDownload(this.role))
      tools.push(button("chip-button", "Download", () => void this.download(entry)));
    if (this.role === "supervisor" && !entry.running)
      tools.push(button("chip-button", "Delete …", () => this.ask(entry.id)));
    return tools;
  }

  private ask(id: string | null): void {
    this.asked = id;
    this.draw();
  }

  private async delete(entry: RecordingEntry): Promise<void> {
    this.asked = null;
    try {
      this.newest = await this.api.delete(entry.id);
      this.beyond = without(this.beyond, entry.id);
      this.say(null);
    } catch (error) {
      this.say(error);
    }
    this.draw();
  }

  private async report(entry: RecordingEntry): Promise<void> {
    this.reports = `Making a report of ${entry.name || entry.id} …`;
    this.draw();
    try {
      saveReport(entry.id, await this.api.report(entry.id));
      this.say(null);
    } catch (error) {
      this.say(error);
    }
    this.reports = "";
    this.draw();
  }

  private async download(entry: RecordingEntry): Promise<void> {
    try {
      await downloadRecording(this.api, entry.id);
      this.say(null);
    } catch (error) {
      this.say(error);
    }
  }
}

function without(list: RecordingList | null, id: string): RecordingList | null {
  return list === null ? null : { ...list, recordings: list.recordings.filter((entry) => entry.id !== id) };
}

export function mayDownload(role: unknown): boolean {
  return role === "operator" || role === "supervisor";
}

/** The browser writes it to disk by itself. Raises ConsoleError. */
export async function downloadRecording(api: RecordingsApi, id: string): Promise<void> {
  const link = h("a", "", { href: await api.download(id), download: "" });
  link.click();
}

function figure(label: string, value: string): HTMLElement {
  return h("span", "row-figure", {}, h("span", "figure-label", {}, label), value);
}

function countWords(found: number, all: number): string {
  return found === all ? `${all}` : `${found} of ${all}`;
}

function marksOf(entry: RecordingEntry): string {
  const names = { contact: "contact", refusal: "refusal", stop: "stop", seat: "hand-over", note: "note" };
  const kept = entry.episodes.get("kept") ?? 0;
  const episodes = entry.episodes.size === 0 ? [] : [`${kept} kept episode${kept === 1 ? "" : "s"}`];
  const found = Object.entries(names)
    .map(([kind, name]) => ({ count: entry.marks.get(kind) ?? 0, name }))
    .filter(({ count }) => count > 0)
    .map(({ count, name }) => `${count} ${name}${count === 1 ? "" : "s"}`);
  return [...episodes, ...found].join(" · ");
}
