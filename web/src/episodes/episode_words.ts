import { lengthOf, type Episode, type Listed } from "./episode_list";
import { elapsed } from "../session/recording_labels";

const PROBLEMS: Readonly<Record<string, string>> = {
  camera_missing: "no pictures",
  camera_slow: "few pictures",
  camera_behind: "pictures behind",
  no_events: "nobody drove for a while",
  recorder_behind: "recorder was slow",
  records_lost: "records are missing",
  disk_low: "disk nearly full",
};

const CUTS: Readonly<Record<string, string>> = {
  epoch: "the robot bridge was restarted",
  link_down: "the robot link was lost",
  recording_ended: "the recording ended",
  recording_failed: "the recording failed",
  new_part: "the recording went on in another file",
  console_ended: "the console ended",
};

export const OUTCOMES: readonly (readonly [Episode["outcome"], string])[] = [
  ["", "Not said"],
  ["success", "Success"],
  ["failure", "Failure"],
];

export interface Tag {
  readonly text: string;
  readonly tone: "good" | "bad" | "off" | "live";
}

/** What is to be known of an episode at a glance. */
export function tagsOf(episode: Episode): Tag[] {
  switch (episode.state) {
    case "open":
      return [{ text: "Recording now", tone: "live" }];
    case "cut":
      return [{ text: "Lost", tone: "bad" }];
    case "discarded":
      return [{ text: "Discarded", tone: "off" }];
    case "kept":
      if (episode.outcome === "success") return [{ text: "Success", tone: "good" }];
      return episode.outcome === "failure" ? [{ text: "Failure", tone: "bad" }] : [];
  }
}

export function hasProblems(episode: Episode): boolean {
  return episode.problems.length > 0 || episode.pause > 0 || episode.state === "cut";
}

/** "no pictures of front · pause of 3.2 s"; "No problems" without any. */
export function qualityWords(episode: Episode): string {
  const words = episode.problems.map(problemWords);
  if (episode.pause > 0) words.push(`pause of ${(episode.pause / 1e6).toFixed(1)} s`);
  if (episode.state === "cut") words.unshift(CUTS[episode.why] ?? "it has no end in the file");
  return words.length === 0 ? "No problems" : words.join(" · ");
}

function problemWords(problem: string): string {
  const [kind = "", ...stream] = problem.split(" ");
  const words = PROBLEMS[kind];
  if (words === undefined) return problem;
  return stream.length === 0 ? words : `${words} of ${stream.join(" ")}`;
}

export function lengthLabel(episode: Episode): string {
  const seconds = lengthOf(episode) / 1e6;
  return seconds < 60 ? `${seconds.toFixed(1)} s` : elapsed(seconds);
}

/** "128 episodes · 96 kept, 1:12:00". */
export function summaryWords(shown: readonly Listed[], all: number): string {
  const kept = shown.filter(({ episode }) => episode.state === "kept");
  const seconds = kept.reduce((sum, { episode }) => sum + lengthOf(episode) / 1e6, 0);
  const count = shown.length === all ? `${all}` : `${shown.length} of ${all}`;
  const noun = all === 1 ? "episode" : "episodes";
  return `${count} ${noun} · ${kept.length} kept, ${elapsed(seconds)}`;
}

/** How the page names an episode. */
export function titleOf(episode: Episode): string {
  return episode.task === "" ? `Take ${episode.number}` : episode.task;
}
