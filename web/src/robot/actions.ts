import type { Action, ActionUpdate, RobotDescription } from "../protocol/wire";

/** So many of the newest are kept. */
const KEPT = 32;

/** The list with this update: it replaces an older one of the same request. */
export function takeUpdate(updates: readonly ActionUpdate[], update: ActionUpdate): readonly ActionUpdate[] {
  const index = updates.findIndex((each) => each.id === update.id);
  if (index >= 0) return updates.with(index, update);
  return [...updates, update].slice(-KEPT);
}

export function isRunning(update: ActionUpdate): boolean {
  return update.state === "running";
}

/** The newest request for this action; null before the first. */
export function newestOf(updates: readonly ActionUpdate[], name: string): ActionUpdate | null {
  return updates.findLast((each) => each.name === name) ?? null;
}

/** The action that moves the robot now; null: none does. */
export function movingNow(updates: readonly ActionUpdate[]): ActionUpdate | null {
  return updates.find((each) => each.moves && isRunning(each)) ?? null;
}

export function actionNamed(description: RobotDescription | null, name: string): Action | null {
  return description?.actions.find((each) => each.name === name) ?? null;
}

/** Why a person cannot ask for an action now. */
export type ActRefusal =
  | "observer"
  | "not_connected"
  | "robot_down"
  | "no_seat"
  | "locked_out"
  | "stopped"
  | "not_armed"
  | "neutral_waits"
  | "driving"
  | "runs"
  | "busy"
  | "hidden"
  | "occupied";

export interface ActConditions {
  readonly operator: boolean;
  readonly connected: boolean;
  readonly robotUp: boolean;
  readonly holdsSeat: boolean;
  readonly lockedOut: boolean;
  readonly stopped: boolean; // or STOP was pressed here
  readonly armed: boolean;
  readonly proven: boolean; // a neutral command was answered since arming
  readonly deadman: boolean; // it is held: a stick may move at any moment
  readonly visible: boolean; // the page is shown and has the keyboard
  readonly occupied: boolean; // the keyboard or the picture belongs to something else: a text field, a dialogue
}

/** Why not; null: it may be asked for. Who wants a motion arms first, as before driving. */
export function actRefusal(
  action: Action,
  updates: readonly ActionUpdate[],
  conditions: ActConditions,
): ActRefusal | null {
  if (!conditions.operator) return "observer";
  if (!conditions.connected) return "not_connected";
  if (!conditions.robotUp) return "robot_down";
  if (!conditions.holdsSeat) return "no_seat";
  if (conditions.lockedOut) return "locked_out";
  if (conditions.stopped) return "stopped";
  if (!conditions.visible) return "hidden";
  if (conditions.occupied) return "occupied";
  if (updates.some((each) => each.name === action.name && isRunning(each))) return "runs";
  if (!action.moves) return null;
  if (movingNow(updates) !== null) return "busy";
  if (!conditions.armed) return "not_armed";
  if (conditions.deadman) return "driving";
  return conditions.proven ? null : "neutral_waits";
}
