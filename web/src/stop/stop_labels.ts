import type { StopFate } from "./stop_press";

/** The button's words while a press lasts; short. */
const PRESSED: Readonly<Record<StopFate, string>> = {
  sending: "sending …",
  confirmed: "the robot confirmed it",
  not_kept: "confirmed, not kept",
  waiting: "NOT AT THE ROBOT YET",
  unconfirmed: "NOT CONFIRMED",
  silenced: "HAD NO EFFECT",
};

const ADVICE: Readonly<Record<StopFate, string | null>> = {
  sending: null,
  confirmed: null,
  not_kept:
    "The robot is stopped, but could not save the stop: if it restarts it may move again. Switch it off with its hardware stop.",
  waiting:
    "Your STOP has not reached the robot. Use the hardware stop now. The console keeps your STOP and sends it first when the robot link is back.",
  unconfirmed: "The robot has not confirmed your STOP. Use the hardware stop now.",
  silenced:
    "Your STOP had no effect: a supervisor silenced your link. Use the hardware stop, or call the supervisor.",
};

/** The button's words while a press lasts. `heard`: the robot's state is known now; a confirmation is of then. */
export function pressedStopLabel(fate: StopFate, heard: boolean): string {
  return fate === "confirmed" && !heard ? "was confirmed; silent now" : PRESSED[fate];
}

/** What a person has to know and do beside the button; null: nothing. `said`: the page still says it. */
export function stopAdvice(fate: StopFate, said: boolean): string | null {
  const advice = ADVICE[fate];
  if (advice === null || fate !== "unconfirmed") return advice;
  return `${advice} ${said ? "This page keeps sending it." : "Press STOP again."}`;
}

/** Of a button that nobody has pressed lately. `heard`: the robot's state is known now, and not only as it was. */
export function restingStopLabel(stopped: boolean, heard: boolean, touch: boolean): string {
  if (stopped) return heard ? "robot is stopped" : "stopped when last heard";
  return touch ? "" : "Esc";
}
