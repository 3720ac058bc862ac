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
      const left = Math.max(0, Math.ceil(state.seconds_left - ageSeconds));
      return { tone: "wait", text: left > 0 ? `Begins in ${left}` : "Begins", time: "", count };
    }
    case "resetting":
      return { tone: "wait", text: `Reset: ${state.reset_action}`, time: "", count };
    case "keeping":
      return { tone: "wait", text: "Being written", time: "", count };
    case "open":
      return {
        tone: state.problems.length > 0 ? "bad" : "on",
        text: `Take ${state.number}`,
        time: elapsed(seconds),
        count,
      };
    case "idle":
      if (recording?.state === "failed")
        return { tone: "bad", text: `Not recording: ${recording.detail}`, time: "", count };
      if (recording?.state !== "recording") return { tone: "off", text: "Record first", time: "", count };
      return { tone: state.last.includes("lost") ? "bad" : "off", text: said(state.last), time: "", count };
  }
}

/** The problems of the open episode, the worst first, in one line. */
export function problemWords(problems: readonly EpisodeProblem[]): string {
  return problems.map((each) => each.text).join(" · ");
}

function countWords({ kept, discarded, cut }: EpisodeState): string {
  const further = [discarded > 0 ? `${discarded} discarded` : "", cut > 0 ? `${cut} lost` : ""];
  return [`${kept} kept`, ...further.filter((words) => words !== "")].join(" · ");
}

function said(last: string): string {
  return last === "" ? "No episode yet" : last.charAt(0).toUpperCase() + last.slice(1);
}
