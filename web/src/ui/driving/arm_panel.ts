import { armRefusal } from "../../drive/arming";
import { holdsSeat, isOperator } from "../../session/console_state";
import type { PadAction } from "../../gamepad/layout";
import { actionName } from "../../gamepad/source_names";
import { isStandard } from "../../gamepad/standard_mapping";
import { warningSeconds } from "../../drive/labels/start_warning";
import { ARM_REFUSAL_LABELS, disarmLabel } from "../../drive/labels/labels";
import type { ConsoleEngine } from "../../engine/console_engine";
import { focusedControl } from "../../input/pointer_focus";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";

const STATE_WORDS = { disarmed: "Disarmed", armed: "Armed", driving: "Driving" } as const;

/** Whether the robot may be driven, and what to do to drive it. */
export function createArmPanel(engine: ConsoleEngine): Panel {
  const state = h("strong", "arm-state");
  const words = h("span", "arm-words");
  const pad = h("span", "arm-pad");
  const toggle = button("arm-button", "Arm", () => {
    engine.toggleArmed();
    toggle.blur();
  });
  const text = h("div", "arm-text", {}, state, words, pad);
  const element = h("section", "arm", { "aria-label": "Driving" }, toggle, text);
  return {
    element,
    update(now) {
      const { arming } = engine.driving;
      setHidden(element, !isOperator(engine.state) && !holdsSeat(engine.state));
      setData(element, "state", arming.state);
      setData(element, "possible", String(armRefusal(arming, engine.conditions(now)) === null));
      setText(state, STATE_WORDS[arming.state]);
      setText(toggle, arming.state === "disarmed" ? "Arm" : "Disarm");
      setText(words, armWords(engine, now));
      setText(pad, padWords(engine));
    },
  };
}

function armWords(engine: ConsoleEngine, now: number): string {
  const warned = warningSeconds(engine.state.feedback, engine.measuredMs, now);
  if (engine.driving.isArmed() && warned > 0) return `The robot warns first: ${warned} s`;
  if (engine.driving.arming.state === "driving") return "Let go to bring the robot to rest";
  if (engine.driving.arming.state === "armed") {
    const hasGoals = engine.state.robot?.description.axes.some((axis) => axis.kind === "goal");
    return `Hold ${deadmanName(engine)} to move${hasGoals ? ", or drag an axis" : ""}`;
  }
  const refusal = armRefusal(engine.driving.arming, engine.conditions(now));
  const focused = focusedControl();
  if (refusal === null && focused !== null && focused !== "Arm")
    return `Enter and Space work “${focused}” now. Tab to Arm, or click the picture`;
  return refusal === null || refusal === "deadman_held"
    ? disarmLabel(engine.driving.arming.reason)
    : ARM_REFUSAL_LABELS[refusal];
}

function deadmanName(engine: ConsoleEngine): string {
  const name = padButton(engine, "deadman");
  if (name === "RB") return "the right bumper (RB)";
  if (name !== null) return name;
  return document.documentElement.dataset["touch"] === "true" ? "a stick" : "the space bar";
}

function padWords(engine: ConsoleEngine): string {
  const state = engine.controls.pad?.state ?? null;
  if (engine.controls.pad?.isSuspended === true) return "A gamepad is being calibrated";
  if (state === null) return "No gamepad: press a button on it to wake it";
  if (!state.ready) return `${state.name} has to be calibrated first: press G`;
  if (!engine.driving.isArmed()) {
    const arm = padButton(engine, "arm");
    return arm === null ? `${state.name} ready` : `${state.name} ready: ${arm} arms`;
  }
  const { shaping } = state.setup;
  const hasLayers = (engine.state.robot?.description.layers.length ?? 0) > 1;
  const hasTurbo = shaping.turbo > shaping.normal;
  const parts: [PadAction, string, boolean][] = [
    ["layer", "layer", hasLayers],
    ["slow", "slow", true],
    ["turbo", "turbo", hasTurbo],
    ["stop", "STOP", true],
  ];
  const words = parts.map(([action, what, isShown]) => (isShown ? padLine(engine, action, what) : null));
  return words.filter((line) => line !== null).join(" · ");
}

function padLine(engine: ConsoleEngine, action: PadAction, what: string): string | null {
  const name = padButton(engine, action);
  return name === null ? null : `${name} ${what}`;
}

/** What the pad in use calls the button of an action; null without such a pad or button. */
function padButton(engine: ConsoleEngine, action: PadAction): string | null {
  const state = engine.controls.pad?.state ?? null;
  const layout = state?.setup.layout ?? null;
  if (state === null || layout === null) return null;
  return actionName(layout, action, isStandard(state.gamepad));
}
