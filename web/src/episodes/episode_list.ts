import { isEvent } from "../gate/serial";
import { isRecord } from "../protocol/schema_check";
import { displayText } from "../util/display_text";

export type EpisodeStateName = "open" | "kept" | "discarded" | "cut";
export type Outcome = "" | "success" | "failure";

/** One episode, with the changes to it (docs/episodes.md). Times in µs since 1970. */
export interface Episode {
  readonly id: string;
  readonly number: number; // counts the takes of a recording
  readonly state: EpisodeStateName;
  readonly editable: boolean;
  readonly restorable: boolean; // a change has discarded it
  readonly task: string;
  readonly outcome: Outcome;
  readonly firstEvent: number;
  readonly lastEvent: number;
  readonly events: number;
  readonly firstBound: number; // a trim stays within
  readonly lastBound: number;
  readonly started: number;
  readonly ended: number;
  readonly why: string; // it was cut
  readonly drivers: readonly string[];
  readonly problems: readonly string[];
  readonly marks: number;
  readonly pause: number; // µs, longest time without a new event; 0: none worth saying
  readonly madeOf: readonly string[];
  readonly mergesWith: string; // "" for none
}

export interface EpisodeChange {
  readonly number: number;
  readonly at: number; // s since 1970
  readonly by: string;
  readonly kind: string;
  readonly episode: string;
  readonly text: string;
  readonly undone: boolean;
  readonly problem: string; // why it has no effect
}

/** One file with its episodes. */
export interface RecordingEpisodes {
  readonly id: string;
  readonly name: string;
  readonly robot: string;
  readonly started: number;
  readonly running: boolean;
  readonly cameras: readonly string[];
  readonly revision: number;
  readonly changes: readonly EpisodeChange[];
  readonly episodes: readonly Episode[];
  readonly trouble: string;
}

/** An episode with the recording that it is of. */
export interface Listed {
  readonly recording: RecordingEpisodes;
  readonly episode: Episode;
}

export interface EpisodeList {
  readonly version: string;
  readonly unchanged: boolean;
  readonly recordings: readonly RecordingEpisodes[];
  readonly older: number;
  readonly pending: number;
  readonly unreadable: number;
}

const STATES: readonly unknown[] = ["open", "kept", "discarded", "cut"];
const OUTCOMES: readonly unknown[] = ["", "success", "failure"];

/** null: it is none. */
export function parseEpisodeList(value: unknown): EpisodeList | null {
  if (!isRecord(value) || typeof value["version"] !== "string" || !Array.isArray(value["recordings"]))
    return null;
  return {
    version: value["version"],
    unchanged: value["unchanged"] === true,
    recordings: value["recordings"].map(parseRecording).filter((each) => each !== null),
    older: count(value["older"]),
    pending: count(value["pending"]),
    unreadable: count(value["unreadable"]),
  };
}

/** null: it is none. */
export function parseRecording(value: unknown): RecordingEpisodes | null {
  if (!isRecord(value)) return null;
  const { info, episodes, changes } = value;
  if (!isRecord(info) || !Array.isArray(episodes) || typeof info["id"] !== "string") return null;
  return {
    id: info["id"],
    name: displayText(info["name"]),
    robot: displayText(info["robot"]),
    started: count(info["started"]),
    running: info["running"] === true,
    cameras: texts(value["cameras"]),
    revision: count(value["revision"]),
    changes: Array.isArray(changes) ? changes.map(parseChange).filter((each) => each !== null) : [],
    episodes: episodes.map(parseEpisode).filter((each) => each !== null),
    trouble: displayText(value["trouble"]),
  };
}

function parseEpisode(value: unknown): Episode | null {
  if (!isRecord(value) || typeof value["id"] !== "string") return null;
  const state = value["state"];
  const outcome = value["outcome"];
  if (!STATES.includes(state) || !OUTCOMES.includes(outcome)) return null;
  const firstEvent = count(value["first_event"]);
  const lastEvent = count(value["last_event"]);
  if (!isEvent(firstEvent) || !isEvent(lastEvent)) return null;
  return {
    id: value["id"],
    number: count(value["number"]),
    state: state as EpisodeStateName,
    editable: value["editable"] === true,
    restorable: value["restorable"] === true,
    task: displayText(value["task"]),
    outcome: outcome as Outcome,
    firstEvent,
    lastEvent,
    events: count(value["events"]),
    firstBound: count(value["first_bound"]) || firstEvent,
    lastBound: count(value["last_bound"]) || lastEvent,
    started: count(value["started"]),
    ended: count(value["ended"]),
    why: displayText(value["why"]),
    drivers: texts(value["drivers"]).map(displayText),
    problems: texts(value["problems"]).map(displayText),
    marks: count(value["marks"]),
    pause: count(value["pause"]),
    madeOf: texts(value["made_of"]),
    mergesWith: typeof value["merges_with"] === "string" ? value["merges_with"] : "",
  };
}

function parseChange(value: unknown): EpisodeChange | null {
  if (!isRecord(value)) return null;
  return {
    number: count(value["number"]),
    at: count(value["at"]),
    by: displayText(value["by"]),
    kind: displayText(value["kind"]),
    episode: typeof value["episode"] === "string" ? value["episode"] : "",
    text: displayText(value["text"]),
    undone: value["undone"] === true,
    problem: displayText(value["problem"]),
  };
}

function count(value: unknown): number {
  return typeof value === "number" && value >= 0 ? value : 0;
}

function texts(value: unknown): string[] {
  return Array.isArray(value) ? value.filter((each) => typeof each === "string") : [];
}

/** In µs. */
export function lengthOf(episode: Episode): number {
  return Math.max(0, episode.ended - episode.started);
}
