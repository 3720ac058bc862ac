import { armRefusal } from "../core/arming";
import { holdsSeat, isOperator } from "../core/console_state";
import { actionName, type PadAction } from "../core/pad_layout";
import { isStandard } from "../core/pad_standard";
import { warningSeconds } from "../core/start_warning";
import { ARM_REFUSAL_WORDS, DISARM_WORDS } from "../core/words";
import type { ConsoleApp } from "../console_app";
import { focusedControl } from "../input/pointer_focus";
import { button, h, setData, setHidden, setText, type Panel } from "./dom";

const STATE_WORDS = { disarmed: "Disarmed", armed: "Armed", driving: "Driving" } as const;

/** Whether the robot may be driven, and what to do to drive it. */
export function createArmPanel(app: ConsoleApp): Panel {
  const state = h("strong", "arm-state");
  const words = h("span", "arm-words");
  const pad = h("span", "arm-pad");
  const toggle = button("arm-button", "Arm", () => {
    app.toggleArmed();
    toggle.blur();
  });
  const text = h("div", "arm-text", {}, state, words, pad);
  const element = h("section", "arm", { "aria-label": "Driving" }, toggle, text);
  return {
    element,
    update(now) {
      const { arming } = app;
      setHidden(element, !isOperator(app.state) && !holdsSeat(app.state));
      setData(element, "state", arming.state);
      setData(element, "possible", String(armRefusal(arming, app.conditions(now)) === null));
      setText(state, STATE_WORDS[arming.state]);
      setText(toggle, arming.state === "disarmed" ? "Arm" : "Disarm");
      setText(words, armWords(app, now));
      setText(pad, padWords(app));
    },
  };
}

function armWords(app: ConsoleApp, now: number): string {
  const warned = warningSeconds(app.state.feedback, app.measuredMs, now);
  if (app.isArmed() && warned > 0) return `The robot warns first: ${warned} s`;
  if (app.arming.state === "driving") return "Let go to bring the robot to rest";
  if (app.arming.state === "armed") return `Hold ${deadmanName(app)} to move`;
  const refusal = armRefusal(app.arming, app.conditions(now));
  const focused = focusedControl();
  if (refusal === null && focused !== null && focused !== "Arm")
    return `Enter and Space work “${focused}” now. Tab to Arm, or click the picture`;
  return refusal === null || refusal === "deadman_held"
    ? DISARM_WORDS[app.arming.reason]
    : ARM_REFUSAL_WORDS[refusal];
}

function deadmanName(app: ConsoleApp): string {
  const name = padButton(app, "deadman");
  if (name === "RB") return "the right bumper (RB)";
  if (name !== null) return name;
  return document.documentElement.dataset["touch"] === "true" ? "a stick" : "the space bar";
}

function padWords(app: ConsoleApp): string {
  const state = app.controls.pad?.state ?? null;
  if (app.controls.pad?.isSuspended === true) return "A gamepad is being calibrated";
  if (state === null) return "No gamepad: press a button on it to wake it";
  if (!state.ready) return `${state.name} has to be calibrated first: press G`;
  if (!app.isArmed()) {
    const arm = padButton(app, "arm");
    return arm === null ? `${state.name} ready` : `${state.name} ready: ${arm} arms`;
  }
  const { shaping } = state.setup;
  const hasLayers = (app.state.robot?.description.layers.length ?? 0) > 1;
  const hasTurbo = shaping.turbo > shaping.normal;
  const parts: [PadAction, string, boolean][] = [
    ["layer", "layer", hasLayers],
    ["slow", "slow", true],
    ["turbo", "turbo", hasTurbo],
    ["stop", "STOP", true],
  ];
  const words = parts.map(([action, what, isShown]) => (isShown ? padLine(app, action, what) : null));
  return words.filter((line) => line !== null).join(" · ");
}

function padLine(app: ConsoleApp, action: PadAction, what: string): string | null {
  const name = padButton(app, action);
  return name === null ? null : `${name} ${what}`;
}

/** What the pad in use calls the button of an action; null without such a pad or button. */
function padButton(app: ConsoleApp, action: PadAction): string | null {
  const state = app.controls.pad?.state ?? null;
  const layout = state?.setup.layout ?? null;
  if (state === null || layout === null) return null;
  return actionName(layout, action, isStandard(state.gamepad));
}
