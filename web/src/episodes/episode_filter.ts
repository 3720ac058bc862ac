import { lengthOf, type Episode, type Listed, type RecordingEpisodes } from "./episode_list";
import { hasProblems, qualityWords } from "./episode_words";
import { dayLabel } from "../replay/recording_list";

export type Sorting = "newest" | "oldest" | "longest" | "shortest" | "task" | "driver" | "worst";
export type StateFilter = "all" | "kept" | "discarded" | "lost";

export interface EpisodeFilter {
  readonly words: string;
  readonly state: StateFilter;
  readonly outcome: "all" | "success" | "failure" | "unsaid";
  readonly quality: "all" | "good" | "problems";
  readonly task: string; // "": all
  readonly driver: string; // "": all
  readonly recording: string; // id; "": all
  readonly sorting: Sorting;
}

export const NO_FILTER: EpisodeFilter = {
  words: "",
  state: "all",
  outcome: "all",
  quality: "all",
  task: "",
  driver: "",
  recording: "",
  sorting: "newest",
};

/** What stays the same of an episode while the list changes around it. */
export function keyOf({ recording, episode }: Listed): string {
  return `${recording.id}\n${episode.id}`;
}

export function allOf(recordings: readonly RecordingEpisodes[]): Listed[] {
  return recordings.flatMap((recording) => recording.episodes.map((episode) => ({ recording, episode })));
}

/** Those that the filter lets through, in its order. */
export function filtered(all: readonly Listed[], filter: EpisodeFilter): Listed[] {
  const words = filter.words.toLowerCase().split(/\s+/).filter(Boolean);
  return all.filter((each) => fits(each, filter, words)).sort(ORDERS[filter.sorting]);
}

export function isFiltering(filter: EpisodeFilter): boolean {
  return (Object.keys(NO_FILTER) as (keyof EpisodeFilter)[]).some(
    (name) => name !== "sorting" && filter[name] !== NO_FILTER[name],
  );
}

function fits({ recording, episode }: Listed, filter: EpisodeFilter, words: readonly string[]): boolean {
  const state = filter.state === "lost" ? ["cut"] : [filter.state];
  const outcome = filter.outcome === "unsaid" ? "" : filter.outcome;
  return (
    (filter.state === "all" || state.includes(episode.state)) &&
    (filter.outcome === "all" || (episode.outcome === outcome && episode.state !== "cut")) &&
    (filter.quality === "all" || hasProblems(episode) === (filter.quality === "problems")) &&
    (filter.task === "" || episode.task === filter.task) &&
    (filter.driver === "" || episode.drivers.includes(filter.driver)) &&
    (filter.recording === "" || recording.id === filter.recording) &&
    (words.length === 0 || hasWords({ recording, episode }, words))
  );
}

function hasWords({ recording, episode }: Listed, words: readonly string[]): boolean {
  const text = [
    episode.task,
    episode.outcome,
    episode.id,
    `take ${episode.number}`,
    ...episode.drivers,
    qualityWords(episode),
    recording.name,
    recording.id,
    recording.robot,
    dayLabel(episode.started),
  ]
    .join(" ")
    .toLowerCase();
  return words.every((word) => text.includes(word));
}

type Order = (one: Listed, other: Listed) => number;

const newest: Order = (one, other) => other.episode.started - one.episode.started || byEvent(one, other);
const ORDERS: Readonly<Record<Sorting, Order>> = {
  newest,
  oldest: (one, other) => one.episode.started - other.episode.started || byEvent(one, other),
  longest: (one, other) => lengthOf(other.episode) - lengthOf(one.episode) || newest(one, other),
  shortest: (one, other) => lengthOf(one.episode) - lengthOf(other.episode) || newest(one, other),
  task: (one, other) => one.episode.task.localeCompare(other.episode.task) || newest(one, other),
  driver: (one, other) => driversOf(one).localeCompare(driversOf(other)) || newest(one, other),
  worst: (one, other) => badness(other.episode) - badness(one.episode) || newest(one, other),
};

function byEvent(one: Listed, other: Listed): number {
  return one.episode.firstEvent - other.episode.firstEvent;
}

function driversOf({ episode }: Listed): string {
  return episode.drivers.join(", ");
}

function badness(episode: Episode): number {
  return episode.problems.length * 1e9 + episode.pause;
}

/** The different values, most frequent first. */
export function valuesOf(all: readonly Listed[], of: (episode: Episode) => readonly string[]): string[] {
  const counts = new Map<string, number>();
  for (const { episode } of all)
    for (const value of of(episode)) if (value !== "") counts.set(value, (counts.get(value) ?? 0) + 1);
  return [...counts].sort(([a, m], [b, n]) => n - m || a.localeCompare(b)).map(([value]) => value);
}
