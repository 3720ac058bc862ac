import { CALIBRATION_STEPS, type Calibration, type CalibrationStep } from "./calibration";
import type { PadSetup } from "./profile";

type ControlName = CalibrationStep["name"];

/** What a part of a pad is for, as a list says it. */
export const CONTROL_NAMES: Readonly<Record<ControlName, string>> = {
  deadman: "Hold to move",
  arm: "Arm",
  stop: "STOP",
  slow: "Slow",
  turbo: "Turbo",
  layer: "Next layer",
  action_1: "First action",
  action_2: "Second action",
  episode: "Episodes",
  left_x: "Left stick, sideways",
  left_y: "Left stick, up and down",
  right_x: "Right stick, sideways",
  right_y: "Right stick, up and down",
  left_trigger: "Left trigger",
  right_trigger: "Right trigger",
  cross_up: "Cross up",
  cross_right: "Cross right",
  cross_down: "Cross down",
  cross_left: "Cross left",
};

const ASKED: Readonly<Record<ControlName, readonly [what: string, about: string]>> = {
  deadman: [
    "Press the button to hold while driving",
    "A shoulder button is best. The robot moves only while it is held.",
  ],
  arm: ["Press the button that arms", "Usually Start or Options."],
  stop: ["Press the button that stops the robot", "Choose one that your thumb finds without looking."],
  left_x: ["Push the left stick all the way right, then all the way left", "Then let it go."],
  left_y: ["Push the left stick all the way up, then all the way down", "Then let it go."],
  right_x: ["Push the right stick all the way right, then all the way left", "Then let it go."],
  right_y: ["Push the right stick all the way up, then all the way down", "Then let it go."],
  left_trigger: ["Pull the left trigger to its end, then let it go", "Skip this step if the pad has none."],
  right_trigger: ["Pull the right trigger to its end, then let it go", "Skip this step if the pad has none."],
  cross_up: ["Press up on the cross", "The directional pad. Skip this step if the pad has none."],
  cross_right: ["Press right on the cross", "Skip this step if the pad has none."],
  cross_down: ["Press down on the cross", "Skip this step if the pad has none."],
  cross_left: ["Press left on the cross", "Skip this step if the pad has none."],
  slow: [
    "Press the button for slow",
    "Hold it together with the other for careful work. You may skip this step.",
  ],
  turbo: [
    "Press the button for turbo",
    "Hold it for turbo speed, which never exceeds the robot's limits. You may skip this step.",
  ],
  layer: [
    "Press the button for the next layer",
    "A layer is a set of axes that the sticks move. You may skip this step.",
  ],
  action_1: [
    "Press the button for the robot's first action",
    "Such as Home: the first button in the row of actions. You may skip this step.",
  ],
  action_2: ["Press the button for the robot's second action", "You may skip this step."],
  episode: [
    "Press the button for episodes",
    "While it is held, others keep or discard an episode. You may skip this step.",
  ],
};

export interface CalibrationPrompt {
  readonly what: string;
  readonly about: string;
  readonly trouble: string; // "" when there is none
}

/** What the user is to do now. */
export function calibrationPrompt(calibration: Calibration): CalibrationPrompt {
  const asked = CALIBRATION_STEPS[calibration.at];
  if (asked === undefined) return { what: "", about: "", trouble: "" };
  const [what, about] = ASKED[asked.name];
  const taken = calibration.taken;
  const name = taken === null ? undefined : CONTROL_NAMES[taken as ControlName];
  return {
    what,
    about,
    trouble: name === undefined ? "" : `That input is already “${name}”. Use another one.`,
  };
}

/** What a list says of a pad. */
export function setupLabel(setup: PadSetup, inUse: boolean): string {
  const how =
    setup.layout === null ? "needs calibration" : setup.calibrated ? "calibrated here" : "standard mapping";
  return inUse ? `in use · ${how}` : how;
}

/** "120 %" */
export function percent(share: number): string {
  return `${Math.round(share * 100)} %`;
}
