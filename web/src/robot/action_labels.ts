import type { Action, ActionUpdate } from "../protocol/wire";

export type Tone = "good" | "wait" | "bad" | "off";

/** What a person reads where an action was refused or cancelled. */
export const ACTION_REASON_LABELS: Readonly<Record<ActionUpdate["reason"], string>> = {
  "": "",
  unknown_action: "the robot has no such action",
  bad_parameter: "a value does not fit",
  late: "it came too late",
  busy: "another action runs",
  driving: "a stick was moved",
  not_neutral: "arm first",
  warning: "the robot warns before it moves",
  not_possible: "not possible now",
  no_seat: "you do not hold the control seat",
  not_allowed: "your link does not permit it",
  too_often: "too many requests at once",
  link_down: "the link to the robot was lost",
  stopped: "the robot was stopped",
  locked_out: "somebody at the robot locked it",
  cancelled: "it was cancelled",
  not_renewed: "no armed command renewed it in time",
  rested: "the driver let go or disarmed",
  interrupted: "the robot interrupted it",
};

const STATES: Readonly<Record<ActionUpdate["state"], string>> = {
  running: "running",
  done: "done",
  failed: "failed",
  cancelled: "cancelled",
  refused: "refused",
};

/** "Home: cancelled, a stick was moved". */
export function actionWords(action: Pick<Action, "label">, update: ActionUpdate): string {
  const why = ACTION_REASON_LABELS[update.reason];
  const parts = [STATES[update.state], why, update.text].filter((each) => each !== "");
  if (update.state === "running") {
    const percent = `${Math.round(update.progress * 100)} %`;
    return `${action.label}: ${[percent, update.text].filter((each) => each !== "").join(" · ")}`;
  }
  return `${action.label}: ${parts.join(" · ")}`;
}

export function actionTone(update: ActionUpdate): Tone {
  if (update.state === "running") return "wait";
  if (update.state === "done") return "good";
  return update.state === "failed" ? "bad" : "wait";
}
