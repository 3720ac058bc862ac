import type { Refusal, ServerMessage } from "../protocol/wire";
import type { DisarmReason } from "./arming";
import { robotIsUp, type ConsoleState } from "../session/console_state";

/** What the page knew of the robot before a message. */
export interface RobotSnapshot {
  readonly stopNumber: number;
  readonly epoch: string | null;
}

export function snapshotOf(state: ConsoleState): RobotSnapshot {
  return { stopNumber: state.stop.number, epoch: state.robot?.epoch ?? null };
}

/**
 * Why nobody may go on driving after a message; null: nothing in it forbids that. Asked for every message, because what
 * was stopped and reset between two looks shows only in the number. `awaitsNeutral`: the person has armed, and the
 * neutral command that follows from it is not answered yet.
 */
export function restartInterlock(
  before: RobotSnapshot,
  state: ConsoleState,
  message: ServerMessage,
  awaitsNeutral: boolean,
): DisarmReason | null {
  const { stop, robot, feedback } = state;
  if (stop.locked_out !== "") return "locked_out";
  if (stop.stopped || stop.number !== before.stopNumber) return "stopped";
  if (robot !== null && (!robotIsUp(state) || (before.epoch !== null && robot.epoch !== before.epoch)))
    return "robot_down";
  if (feedback?.neutral_needed === true && !awaitsNeutral) return "neutral_needed";
  return message.type === "refusal" && message.event !== 0 ? (REFUSED[message.reason] ?? null) : null;
}

/** Refusals of a command that trying again does not cure. */
const REFUSED: Partial<Record<Refusal["reason"], DisarmReason>> = {
  stopped: "stopped",
  locked_out: "locked_out",
  no_seat: "seat_lost",
  not_neutral: "neutral_needed",
};
