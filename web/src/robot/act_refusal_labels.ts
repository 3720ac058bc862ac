import type { ActRefusal } from "./actions";

/** Why an action cannot be asked for now. */
export const ACT_REFUSAL_LABELS: Readonly<Record<ActRefusal, string>> = {
  observer: "This link is for watching",
  not_connected: "Not connected to the console",
  robot_down: "The robot cannot be reached",
  no_seat: "Get the control seat first",
  locked_out: "Somebody at the robot has locked it",
  stopped: "Reset the stop first",
  not_armed: "Arm first: this moves the robot",
  neutral_waits: "Arming: wait for the robot's answer",
  driving: "Let go of the hold-to-run control first",
  runs: "It runs already",
  busy: "Another action moves the robot",
  hidden: "The page is not in front",
  occupied: "First close the window over the picture, or leave the text field",
};
