import type { Refusal } from "../protocol/wire";

/** What to do about a reset that was refused. */
export const RESET_WORDS: Partial<Record<Refusal["reason"], string>> = {
  stale_reset: "Not reset: somebody pressed STOP again. Look at the newest stop, then hold again.",
  too_soon: "Not reset: the stop is less than a second old. Look at the robot, then hold again.",
  locked_out: "Not reset: somebody at the robot has locked it. Unlock it there first.",
  no_seat: "Not reset: you do not have control. Request it, or ask a supervisor.",
  not_allowed: "Not reset: your link does not permit it. Ask the driver or a supervisor.",
  too_often: "Not reset: too many tries. Wait a few seconds, then hold again.",
  not_kept:
    "Not reset: the robot could not write the reset to its disk. The robot stays stopped; check its disk.",
  link_down: "Not reset: the console has no link to the robot. The robot stays stopped.",
};
