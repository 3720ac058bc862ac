import { NO_FILTER, valuesOf, type EpisodeFilter } from "../episode_filter";
import type { Listed } from "../episode_list";
import { h, setHidden } from "../../ui/elements/dom";

type Choices = readonly (readonly [string, string])[];

const STATES: Choices = [
  ["all", "Kept and not"],
  ["kept", "Kept"],
  ["discarded", "Discarded"],
  ["lost", "Lost"],
];
const OUTCOMES: Choices = [
  ["all", "Any outcome"],
  ["success", "Success"],
  ["failure", "Failure"],
  ["unsaid", "Not said"],
];
const QUALITIES: Choices = [
  ["all", "Any quality"],
  ["good", "Without problems"],
  ["problems", "With problems"],
];
const SORTINGS: Choices = [
  ["newest", "Newest first"],
  ["oldest", "Oldest first"],
  ["longest", "Longest first"],
  ["shortest", "Shortest first"],
  ["task", "By task"],
  ["driver", "By driver"],
  ["worst", "Most problems first"],
];
const MOST_VALUES = 200; // tasks or drivers to choose from
const KEPT = "lockstep.episodes.sorting";

/** Which episodes are shown, and in which order. The order is kept in this browser; a filter is not. */
export class FilterBar {
  readonly element: HTMLElement;
  private readonly words = h("input", "field filter-words", {
    type: "search",
    placeholder: "Search by task, driver, recording or day",
    "aria-label": "Search episodes",
    spellcheck: "false",
  });
  private readonly state = select("Kept or not", STATES);
  private readonly outcome = select("Outcome", OUTCOMES);
  private readonly quality = select("Quality", QUALITIES);
  private readonly task = select("Task", [["", "Any task"]]);
  private readonly driver = select("Driver", [["", "Any driver"]]);
  private readonly recording = select("Recording", [["", "All recordings"]]);
  private readonly sorting = select("Order", SORTINGS);
  private offered = "";

  /** `recording`: id of the one to begin with; "": all. */
  constructor(recording: string, changed: () => void) {
    this.sorting.value = keptSorting();
    this.words.addEventListener("input", changed);
    const selects = [this.state, this.outcome, this.quality, this.task, this.driver, this.recording];
    for (const each of selects) each.addEventListener("change", changed);
    this.sorting.addEventListener("change", () => {
      keepSorting(this.sorting.value);
      changed();
    });
    if (recording !== "") this.offer(this.recording, [recording], "All recordings", recording);
    const more = h(
      "details",
      "filter-more",
      {},
      h("summary", "filter-summary", {}, "Filter and order"),
      h("div", "filter-choices", {}, ...selects, this.sorting),
    );
    more.open = matchMedia("(min-width: 1000px)").matches;
    this.element = h("div", "episode-filter", {}, this.words, more);
  }

  get filter(): EpisodeFilter {
    return {
      words: this.words.value,
      state: this.state.value as EpisodeFilter["state"],
      outcome: this.outcome.value as EpisodeFilter["outcome"],
      quality: this.quality.value as EpisodeFilter["quality"],
      task: this.task.value,
      driver: this.driver.value,
      recording: this.recording.value,
      sorting: this.sorting.value as EpisodeFilter["sorting"],
    };
  }

  clear(): void {
    this.words.value = "";
    this.state.value = this.outcome.value = this.quality.value = "all";
    this.task.value = this.driver.value = this.recording.value = "";
  }

  /** The tasks, drivers and recordings that there are. */
  update(all: readonly Listed[]): void {
    const tasks = valuesOf(all, (episode) => [episode.task]);
    const drivers = valuesOf(all, (episode) => episode.drivers);
    const recordings = [
      ...new Map(all.map(({ recording }) => [recording.id, recording.name || recording.id])),
    ];
    const offered = JSON.stringify([tasks, drivers, recordings]);
    if (offered === this.offered) return;
    this.offered = offered;
    this.offer(this.task, tasks, "Any task");
    this.offer(this.driver, drivers, "Any driver");
    this.offer(
      this.recording,
      recordings.map(([id]) => id),
      "All recordings",
      "",
      new Map(recordings),
    );
    setHidden(this.recording, recordings.length < 2 && this.recording.value === "");
    setHidden(this.driver, drivers.length < 2 && this.driver.value === "");
  }

  private offer(
    field: HTMLSelectElement,
    values: readonly string[],
    all: string,
    chosen = field.value,
    names: ReadonlyMap<string, string> = new Map(),
  ): void {
    const before = chosen || field.value;
    const offered = before === "" || values.includes(before) ? values : [before, ...values];
    field.replaceChildren(
      h("option", "", { value: "" }, all),
      ...offered.slice(0, MOST_VALUES).map((value) => h("option", "", { value }, names.get(value) ?? value)),
    );
    field.value = before;
  }
}

function select(label: string, choices: Choices): HTMLSelectElement {
  const options = choices.map(([value, words]) => h("option", "", { value }, words));
  return h("select", "field filter-choice", { "aria-label": label }, ...options);
}

function keptSorting(): string {
  try {
    const kept = localStorage.getItem(KEPT) ?? "";
    return SORTINGS.some(([value]) => value === kept) ? kept : NO_FILTER.sorting;
  } catch {
    return NO_FILTER.sorting;
  }
}

function keepSorting(sorting: string): void {
  try {
    localStorage.setItem(KEPT, sorting);
  } catch {
    // It holds until the page is closed.
  }
}
