import type { Refusal } from "../wire";
import type { ArmRefusal, DisarmReason } from "./arming";
import type { GateState } from "./command_gate";
import type { GateBlock } from "./gate_block";

type RefusalReason = Refusal["reason"];

/** What an operator reads for each refusal. */
export const REFUSAL_WORDS: Readonly<Record<RefusalReason, string>> = {
  late: "It came too late: the feedback it answers is too old",
  out_of_order: "It is not the next event",
  rested: "The robot was told to rest before it arrived",
  stopped: "The robot is stopped",
  not_a_number: "A value was not a number",
  wrong_size: "It did not have one value for each axis",
  malformed: "The console could not read it",
  no_seat: "You do not hold the control seat",
  seat_taken: "Somebody else holds the control seat",
  declined: "Whoever drives said no, or did not answer",
  not_neutral: "The robot asks for a neutral command first: let go, then arm",
  unseen: "It did not name the feedback that it answers",
  stale_reset: "Somebody pressed STOP again: look at the newest stop before you reset",
  too_soon: "The stop is less than a second old: wait a moment",
  not_kept: "The robot could not write the reset to its disk: it stays stopped",
  locked_out: "Somebody at the robot has locked it",
  warning: "The robot warns before it moves: wait a moment",
  silenced: "A supervisor silenced the stops of your link",
  too_often: "That is too much at once: wait a moment",
  not_allowed: "Your link does not permit it",
  link_down: "The console has no link to the robot",
};

export const GATE_WORDS: Readonly<Record<GateState, string>> = {
  open: "Ready for the next command",
  no_feedback: "Waiting for the first feedback",
  in_flight: "Waiting for the robot's answer",
  rate: "Keeping to the robot's event rate",
  picture: "Waiting for a fresh picture",
  sound: "Waiting for fresh sound",
};

export const GATE_BLOCK_WORDS: Readonly<Record<GateBlock, string>> = {
  not_connected: "Not connected",
  console_silent: "The console is silent",
  robot_down: "The robot cannot be reached",
  locked_out: "Somebody at the robot has locked it",
  stopped: "The robot is stopped",
  stop_pressed: "You pressed STOP",
  no_seat: "The control seat is not yours",
};

export const ARM_REFUSAL_WORDS: Readonly<Record<ArmRefusal, string>> = {
  observer: "This link is for watching",
  not_connected: "Not connected to the console",
  robot_down: "The robot cannot be reached",
  no_seat: "Get the control seat first",
  locked_out: "Somebody at the robot has locked it",
  stopped: "The robot is stopped: reset it first",
  stop_pressed: "You pressed STOP, and the robot does not show it yet",
  hidden: "The page is hidden",
  occupied: "Close what is open over the picture, or leave the text field, first",
  deadman_held: "Let go of the hold-to-run control first",
};

export const DISARM_WORDS: Readonly<Record<DisarmReason, string>> = {
  start: "Arm to drive",
  operator: "Disarmed by you",
  blur: "Disarmed: the window lost focus",
  hidden: "Disarmed: the page was hidden",
  pad_lost: "Disarmed: the gamepad is gone",
  pad_silent: "Disarmed: the gamepad fell silent. Is it in range, and charged?",
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

export function eventsBehind(count: number): string {
  return count === 1 ? "1 event behind" : `${count} events behind`;
}
