import type { ActConditions } from "../robot/actions";
import type { ConsoleEngine } from "./console_engine";

/** `remote`: asked by a pad or a key, which work wherever the eyes are; a click is on a button that is seen. */
export function actConditions(engine: ConsoleEngine, now: number, remote: boolean): ActConditions {
  const { driving } = engine;
  const all = engine.conditions(now);
  const { operator, connected, robotUp, holdsSeat, lockedOut, stopped, stopPressed } = all;
  return {
    visible: !remote || (all.visible && document.hasFocus()),
    occupied: remote && all.occupied,
    ...{ operator, connected, robotUp, holdsSeat, lockedOut },
    stopped: stopped || stopPressed,
    armed: driving.isArmed(),
    proven: driving.driver?.unproven === false,
    deadman: driving.arming.state === "driving",
  };
}
