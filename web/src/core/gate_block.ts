import { holdsSeat, robotIsUp, type ConsoleState } from "./console_state";

/** What shuts the gate before its own rule is asked. */
export type GateBlock = "not_connected" | "robot_down" | "stopped" | "no_seat";

/** The first that holds; null when nothing does. */
export function gateBlock(state: ConsoleState): GateBlock | null {
  if (state.welcome === null) return "not_connected";
  if (!robotIsUp(state)) return "robot_down";
  if (state.stop.stopped) return "stopped";
  return holdsSeat(state) ? null : "no_seat";
}
