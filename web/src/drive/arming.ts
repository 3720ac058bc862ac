/** disarmed: nothing moves. armed: the deadman may be pressed. driving: it is held. */
export type ArmState = "disarmed" | "armed" | "driving";

export type ArmRefusal =
  | "observer"
  | "not_connected"
  | "robot_down"
  | "no_seat"
  | "locked_out"
  | "stopped"
  | "stop_pressed"
  | "hidden"
  | "occupied"
  | "deadman_held";

export type DisarmReason =
  | "start"
  | "operator"
  | "blur"
  | "hidden"
  | "pad_lost"
  | "pad_silent"
  | "connection_lost"
  | "robot_down"
  | "seat_lost"
  | "occupied"
  | "stopped"
  | "stop_pressed"
  | "locked_out"
  | "neutral_needed"
  | "taped_down"
  | HeadsetDisarmReason;

/** Reasons that only a headset's session has. */
export type HeadsetDisarmReason =
  | "squeeze_released"
  | "tracking_lost"
  | "headset_off"
  | "headset_blurred"
  | "headset_silent"
  | "headset_left"
  | "battery_low";

export interface ArmConditions {
  readonly operator: boolean;
  readonly connected: boolean;
  readonly robotUp: boolean;
  readonly holdsSeat: boolean;
  readonly lockedOut: boolean; // by somebody at the robot
  readonly stopped: boolean; // the robot says so
  readonly stopPressed: boolean; // here, and the robot does not show it yet
  readonly visible: boolean;
  readonly occupied: boolean; // the keyboard or the picture belongs to something else: a text field, a dialogue
}

export interface Arming {
  state: ArmState;
  reason: DisarmReason; // why it is disarmed; of the last time otherwise
  deadman: boolean; // held at the last sample
  input: string; // what was held at the last change, to notice a deadman that is taped down
  inputSinceMs: number;
}

/** A deadman held with nothing else changing for this long counts as taped down. */
const UNCHANGED_LIMIT_MS = 60_000;

export function createArming(): Arming {
  return { state: "disarmed", reason: "start", deadman: true, input: "", inputSinceMs: 0 };
}

/** Why arming is not possible now; null when it is. The deadman must have been seen released. */
export function armRefusal(arming: Arming, conditions: ArmConditions): ArmRefusal | null {
  if (!conditions.operator) return "observer";
  if (!conditions.connected) return "not_connected";
  if (!conditions.robotUp) return "robot_down";
  if (!conditions.holdsSeat) return "no_seat";
  if (conditions.lockedOut) return "locked_out";
  if (conditions.stopped) return "stopped";
  if (conditions.stopPressed) return "stop_pressed";
  if (!conditions.visible) return "hidden";
  if (conditions.occupied) return "occupied";
  return arming.deadman ? "deadman_held" : null;
}

/** Arms if it may; says why not otherwise. `held`: the deadman is, by now; the last sample may not know it yet. */
export function arm(arming: Arming, conditions: ArmConditions, held: boolean): ArmRefusal | null {
  if (arming.state !== "disarmed") return null;
  const refusal = armRefusal(arming, conditions) ?? (held ? "deadman_held" : null);
  if (refusal === null) arming.state = "armed";
  return refusal;
}

/** Says whether it was armed. */
export function disarm(arming: Arming, reason: DisarmReason): boolean {
  if (arming.state === "disarmed") return false;
  arming.state = "disarmed";
  arming.reason = reason;
  return true;
}

/** The seat is held anew: what disarmed an earlier turn is no longer news. */
export function startAfresh(arming: Arming): void {
  if (arming.state === "disarmed") arming.reason = "start";
}

/** Whether the robot would execute a command of this page at all. */
export function mayCommand(conditions: ArmConditions): boolean {
  const { operator, robotUp, holdsSeat, lockedOut, stopped, stopPressed } = conditions;
  return operator && robotUp && holdsSeat && !lockedOut && !stopped && !stopPressed;
}

/** What the first condition that no longer holds means for one who is armed; null when all hold. */
export function lostCondition(conditions: ArmConditions): DisarmReason | null {
  if (!conditions.connected) return "connection_lost";
  if (conditions.lockedOut) return "locked_out";
  if (conditions.stopped) return "stopped";
  if (conditions.stopPressed) return "stop_pressed";
  if (!conditions.robotUp) return "robot_down";
  if (!conditions.operator || !conditions.holdsSeat) return "seat_lost";
  if (!conditions.visible) return "hidden";
  return conditions.occupied ? "occupied" : null;
}

/**
 * Takes what is held now. `input` names it, so that an unchanged one can be told.
 * Returns "released" when the deadman was let go and "taped_down" when it disarmed for that.
 */
export function sampleDeadman(
  arming: Arming,
  deadman: boolean,
  input: string,
  now: number,
): "released" | "taped_down" | null {
  if (!deadman || input !== arming.input || !arming.deadman) {
    arming.input = input;
    arming.inputSinceMs = now;
  }
  const wasDriving = arming.state === "driving";
  arming.deadman = deadman;
  if (arming.state !== "disarmed") arming.state = deadman ? "driving" : "armed";
  if (wasDriving && !deadman) return "released";
  if (arming.state === "driving" && now - arming.inputSinceMs >= UNCHANGED_LIMIT_MS) {
    disarm(arming, "taped_down");
    return "taped_down";
  }
  return null;
}
