import type { EpisodeAnswer, EpisodeProblem, EpisodeState, RecordingState } from "../protocol/wire";
import { elapsed } from "./recording_labels";

export const EPISODE_REFUSALS: Readonly<Record<EpisodeAnswer["reason"], string>> = {
  "": "",
  not_allowed: "only whoever has control, and supervisors",
  too_often: "too many requests",
  recording_off: "nothing is recorded",
  link_down: "the robot is away",
  no_task: "say in words what is to be done",
  episode_open: "an episode is open already",
  no_episode: "no episode is open",
  other_episode: "another episode is open by now",
  empty: "nothing was driven in it yet",
  not_written: "it could not be written",
};

export type EpisodeTone = "off" | "wait" | "on" | "bad";

export interface EpisodeLabels {
  readonly tone: EpisodeTone;
  readonly text: string; // what is going on
  readonly time: string; // how long the episode has run; "" for none
  readonly count: string;
}

/** The page's words about episodes. `ageSeconds`: since the state came, `seconds`: since the episode began. */
export function episodeLabels(
  state: EpisodeState,
  recording: RecordingState | null,
  ageSeconds: number,
  seconds: number,
): EpisodeLabels {
  const count = countWords(state);
  switch (state.phase) {
    case "countdown": {
      if (isSilent(state, ageSeconds)) return { tone: "bad", text: SILENT, time: "", count };
      const left = Math.max(0, Math.ceil(state.seconds_left - ageSeconds));
      return { tone: "wait", text: left > 0 ? `Begins in ${left}` : "Begins", time: "", count };
    }
    case "resetting":
      if (isSilent(state, ageSeconds)) return { tone: "bad", text: SILENT, time: "", count };
      return { tone: "wait", text: `Reset: ${state.reset_action}`, time: "", count };
    case "keeping":
      if (isSilent(state, ageSeconds)) return { tone: "bad", text: unknownWords(state), time: "", count };
      return { tone: "wait", text: "Being written", time: "", count };
    case "open":
      if (isSilent(state, ageSeconds)) return { tone: "bad", text: unknownWords(state), time: "", count };
      return {
        tone: state.problems.length > 0 ? "bad" : "on",
        text: `Take ${state.number}`,
        time: elapsed(seconds),
        count,
      };
    case "idle": {
      const isLost = hasLost(state);
      const hint = recordingHint(recording);
      if (isLost && recording?.state === "failed") {
        // The line has no room for both.
        const isCause = state.lost === "recording_failed";
        const text = isCause ? `Episode ${state.number} is lost: ${recording.detail}` : said(state.last);
        return { tone: "bad", text, time: "", count };
      }
      const text = [isLost || hint === "" ? said(state.last) : "", hint].filter(Boolean).join(" · ");
      return { tone: isLost || recording?.state === "failed" ? "bad" : "off", text, time: "", count };
    }
  }
}

const SILENT_SECONDS = 3;
const SILENT = "The console does not answer";
const HEARD: ReadonlySet<EpisodeState["phase"]> = new Set(["countdown", "keeping", "open", "resetting"]);

/** Whether nothing was heard of an episode on its way for longer than that takes: every second. */
export function isSilent({ phase }: EpisodeState, ageSeconds: number): boolean {
  return HEARD.has(phase) && ageSeconds > SILENT_SECONDS;
}

/** Nobody knows what becomes of an episode while the console does not answer. */
export function unknownWords({ number }: Pick<EpisodeState, "number">): string {
  return `Take ${number}: the console does not answer`;
}

function readsWords({ number }: Pick<EpisodeState, "number">): string {
  return `episode ${number}: the console reads its recordings`;
}

/** Whether the last episode was lost. */
export function hasLost({ phase, lost }: EpisodeState): boolean {
  return phase === "idle" && lost !== "";
}

/** Why no episode can begin; "" where one can. */
function recordingHint(recording: RecordingState | null): string {
  if (recording?.state === "failed") return `Not recording: ${recording.detail}`;
  return recording?.state === "recording" ? "" : "Record first";
}

const NAMES: Readonly<Record<EpisodeProblem["kind"], string>> = {
  // The worst first: a line that is too short for all leaves out the last.
  camera_missing: "no picture",
  records_lost: "records are missing",
  disk_low: "the disk is almost full",
  recorder_behind: "the disk is too slow",
  camera_behind: "pictures are late",
  camera_slow: "too few pictures",
  no_events: "nobody drives",
};
const ORDER = Object.keys(NAMES);

/** The problems of the open episode, the worst first, in one line. */
export function problemWords(problems: readonly EpisodeProblem[]): string {
  return worstFirst(problems)
    .map((each) => each.text)
    .join(" · ");
}

/** The same without figures, which would be read aloud every second. */
export function spokenProblems(problems: readonly EpisodeProblem[]): string {
  return worstFirst(problems)
    .map(({ kind, stream }) => (stream === "" ? NAMES[kind] : `${stream}: ${NAMES[kind]}`))
    .join(", ");
}

function worstFirst(problems: readonly EpisodeProblem[]): EpisodeProblem[] {
  return problems.toSorted((one, other) => ORDER.indexOf(one.kind) - ORDER.indexOf(other.kind));
}

/** An episode that was being recorded when the connection ended. */
export interface LeftEpisode {
  readonly episode: string;
  readonly number: number;
}

/** null: none was. */
export function leftEpisode(state: EpisodeState | null): LeftEpisode | null {
  return state?.phase === "open" || state?.phase === "keeping"
    ? { episode: state.episode, number: state.number }
    : null;
}

/**
 * The state with what is known of that episode. Another process of the console says what became of it once it has read
 * the recordings, unless that is long ago.
 */
export function withLeftEpisode(state: EpisodeState, left: LeftEpisode | null): EpisodeState {
  if (left === null || [state.episode, state.last_episode].includes(left.episode)) return state;
  if (state.reads_recordings) return { ...state, last: readsWords(left) };
  const last = `episode ${left.number}: the console ended, the list of episodes says whether it is kept`;
  return { ...state, last, lost: "console_ended" };
}

function countWords({ kept, discarded, cut }: EpisodeState): string {
  const further = [discarded > 0 ? `${discarded} discarded` : "", cut > 0 ? `${cut} lost` : ""];
  return [`${kept} kept`, ...further.filter((words) => words !== "")].join(" · ");
}

function said(last: string): string {
  return last === "" ? "No episode yet" : last.charAt(0).toUpperCase() + last.slice(1);
}
