import { GoalDriving } from "../drive/goals/goal_driving";
import { GoalSliders } from "../input/goal_sliders";
import type { ConsoleEngine } from "./console_engine";

/** Lets the page drive goal axes. Before this they stay where they are. */
export function addGoalControls(engine: ConsoleEngine): GoalSliders {
  const sliders = new GoalSliders();
  sliders.onchange = (at) => engine.controls.events.changed(at);
  engine.controls.sliders = sliders;
  engine.driving.goals = new GoalDriving();
  return sliders;
}
