import { holdsSeat, robotIsUp, type ConsoleState } from "../../session/console_state";

/** What shuts the gate before its own rule is asked. */
export type GateReason =
  "not_connected" | "console_silent" | "robot_down" | "locked_out" | "stopped" | "stop_pressed" | "no_seat";

/**
 * The first that holds; null when nothing does. `hears`: the console has spoken lately. `stopPressed`: here, and the
 * robot does not show it yet.
 */
export function gateReason(state: ConsoleState, hears: boolean, stopPressed: boolean): GateReason | null {
  if (state.welcome === null) return "not_connected";
  if (!hears) return "console_silent";
  if (!robotIsUp(state)) return "robot_down";
  if (state.stop.locked_out !== "") return "locked_out";
  if (state.stop.stopped) return "stopped";
  if (stopPressed) return "stop_pressed";
  return holdsSeat(state) ? null : "no_seat";
}
