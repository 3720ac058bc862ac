import { AxesHelper, type Material } from "three";
import type { RobotDescription } from "../protocol/wire";
import { toolFrames, type ToolState } from "../robot/tool_frames";
import type { RigidPose } from "../util/rigid";
import type { RobotModel } from "./robot_model";

const SHARE = 0.16; // of the robot's size: the length of a frame's axes
const GOAL = 0.45; // opacity

/** The frames of the robot's tools, where they were measured and, paler, where they are to be. `size`: m. */
export function toolSign(
  model: RobotModel,
  description: RobotDescription,
  size: number,
): { show(state: ToolState): void } {
  const tools = description.poses.map(() => {
    const measured = new AxesHelper(SHARE * size);
    const goal = new AxesHelper(SHARE * size);
    for (const each of [measured, goal]) {
      each.renderOrder = 1; // a frame inside of a hand is seen too
      for (const material of [each.material].flat()) seen(material);
    }
    (goal.material as Material).opacity = GOAL;
    model.root.add(measured, goal);
    return { measured, goal };
  });
  return {
    show(state) {
      for (const [at, { measured, goal }] of toolFrames(description, state).entries()) {
        const tool = tools[at];
        if (tool === undefined) continue;
        put(tool.measured, measured);
        put(tool.goal, goal);
      }
    },
  };
}

function seen(material: Material): void {
  material.depthTest = false;
  material.transparent = true;
}

function put(frame: AxesHelper, pose: RigidPose | null): void {
  frame.visible = pose !== null;
  if (pose === null) return;
  frame.position.fromArray([...pose.position]);
  frame.quaternion.fromArray([...pose.orientation]);
}
