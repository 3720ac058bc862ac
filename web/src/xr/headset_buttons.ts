export type ButtonName = "leave" | "recentre" | "reset" | "stop";

/**
 * What a hand presses that points at this button. A hand that drives presses STOP alone: its trigger is the gripper's,
 * wherever the hand points. `pointed`: null: at none.
 */
export function pressable(pointed: ButtonName | null, drives: boolean): ButtonName | null {
  return drives && pointed !== "stop" ? null : pointed;
}
