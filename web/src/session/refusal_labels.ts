import type { Refusal } from "../protocol/wire";

type RefusalReason = Refusal["reason"];

/** What an operator reads for each refusal. */
export const REFUSAL_LABELS: Readonly<Record<RefusalReason, string>> = {
  late: "The command came too late: the feedback that it answers is too old",
  out_of_order: "The command is not for the next event",
  rested: "The robot was told to rest before the command arrived",
  stopped: "The robot is stopped",
  not_a_number: "The command has a value that is not a number",
  wrong_size: "The command does not have one value for each axis",
  jump: "The goal is too far from where the robot is: let go, then begin again",
  conflict: "Two controls move the same joints: let go of one",
  malformed: "The console could not read the message",
  no_seat: "You do not hold the control seat",
  seat_taken: "Somebody else holds the control seat",
  declined: "The driver declined, or did not answer",
  not_neutral: "The robot asks for a neutral command first: let go, then arm",
  unseen: "The command does not name the feedback that it answers",
  stale_reset: "Somebody pressed STOP again: look at the newest stop before you reset",
  too_soon: "The stop is less than a second old: wait a moment",
  not_kept: "The robot could not write the reset to its disk: it stays stopped",
  locked_out: "Somebody at the robot has locked it",
  warning: "The robot warns before it moves: wait a moment",
  silenced: "A supervisor silenced the stops of your link",
  too_often: "Too many requests at once: wait a moment",
  not_allowed: "Your link does not permit this",
  link_down: "The console has no link to the robot",
};
