import type { ArmRefusal, DisarmReason, HeadsetDisarmReason } from "../arming";
import type { GateState } from "../command_gate";
import type { GateReason } from "./gate_reason";

export const GATE_LABELS: Readonly<Record<GateState, string>> = {
  open: "Ready for the next command",
  no_feedback: "Waiting for the first feedback",
  in_flight: "Waiting for the robot's answer",
  rate: "Keeping to the robot's event rate",
  picture: "Waiting for a fresh picture",
  sound: "Waiting for fresh sound",
};

export const GATE_REASON_LABELS: Readonly<Record<GateReason, string>> = {
  not_connected: "Not connected",
  console_silent: "The console is silent",
  robot_down: "The robot cannot be reached",
  locked_out: "Somebody at the robot has locked it",
  stopped: "The robot is stopped",
  stop_pressed: "You pressed STOP",
  no_seat: "The control seat is not yours",
};

export const ARM_REFUSAL_LABELS: Readonly<Record<ArmRefusal, string>> = {
  observer: "This link is for watching",
  not_connected: "Not connected to the console",
  robot_down: "The robot cannot be reached",
  no_seat: "Get the control seat first",
  locked_out: "Somebody at the robot has locked it",
  stopped: "The robot is stopped: reset it first",
  stop_pressed: "You pressed STOP, and the robot does not show it yet",
  hidden: "The page is hidden",
  occupied: "First close the window over the picture, or leave the text field",
  deadman_held: "Let go of the hold-to-run control first",
};

const DISARM_LABELS: Readonly<Record<Exclude<DisarmReason, HeadsetDisarmReason>, string>> = {
  start: "Arm to drive",
  operator: "Disarmed by you",
  blur: "Disarmed: the window lost focus",
  hidden: "Disarmed: the page was hidden",
  pad_lost: "Disarmed: the gamepad was disconnected",
  pad_silent: "Disarmed: the gamepad fell silent. Check its range and its battery",
  connection_lost: "Disarmed: the connection was lost",
  robot_down: "Disarmed: the robot cannot be reached",
  seat_lost: "Disarmed: the control seat was lost",
  occupied: "Disarmed: you turned to a text field or a dialogue",
  stopped: "Disarmed: the robot was stopped",
  stop_pressed: "Disarmed: you pressed STOP",
  locked_out: "Disarmed: somebody at the robot locked it",
  neutral_needed: "Disarmed: the robot interrupted the motion. Arm to go on",
  taped_down: "Disarmed: hold-to-run was held a minute without change",
};

let headsetLabels: Readonly<Partial<Record<DisarmReason, string>>> = {};

/** The headset's view brings its labels with it, so that the page's first files stay small. */
export function addDisarmLabels(labels: Readonly<Record<HeadsetDisarmReason, string>>): void {
  headsetLabels = labels;
}

export function disarmLabel(reason: DisarmReason): string {
  const labels: Readonly<Partial<Record<DisarmReason, string>>> = DISARM_LABELS;
  return labels[reason] ?? headsetLabels[reason] ?? "Disarmed";
}
