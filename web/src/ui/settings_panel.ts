import { capHolds, capIsChoice } from "../core/speed_cap";
import type { Settings } from "../core/console_state";
import type { ConsoleApp } from "../console_app";
import { button, h, setData, setPressed, setText, type Panel } from "./dom";

const MAX_TOLERANCE = 99;

type Part = { readonly element: HTMLElement; update(): void };

/** Tolerances, pacing, and the gate itself. */
export function createSettingsPanel(app: ConsoleApp): Panel {
  const parts: Part[] = [
    createStepper(app, "Picture tolerance", "video"),
    createStepper(app, "Sound tolerance", "audio"),
    createPacing(app),
    createCap(app),
    createFlag(app, "Rumble", "rumble", "The gamepad rumbles with the force, while armed"),
    createFlag(app, "Contact tone", "contactTone", "A tone that rises with the force"),
    createGate(app),
  ];
  const head = h("div", "card-head", {}, h("h2", "", {}, "Gate and pacing"));
  return {
    element: h(
      "section",
      "card settings",
      { "aria-label": "Settings" },
      head,
      ...parts.map((part) => part.element),
    ),
    update() {
      for (const part of parts) part.update();
    },
  };
}

function createStepper(app: ConsoleApp, label: string, kind: "audio" | "video"): Part {
  const value = h("output", "stepper-value");
  const step = (by: number) => (): void => {
    const { tolerance } = app.state.settings;
    tolerance[kind] = Math.min(MAX_TOLERANCE, Math.max(0, tolerance[kind] + by));
    app.settingsChanged();
  };
  const less = button("stepper-button", "−", step(-1));
  const more = button("stepper-button", "+", step(1));
  less.setAttribute("aria-label", `${label}: one event less`);
  more.setAttribute("aria-label", `${label}: one event more`);
  const control = h("span", "stepper", {}, less, value, more);
  return {
    element: h("div", "setting", {}, h("span", "setting-label", {}, label), control),
    update: () => setText(value, String(app.state.settings.tolerance[kind])),
  };
}

function createPacing(app: ConsoleApp): Part {
  const choose = (pacing: Settings["pacing"]) => (): void => {
    app.state.settings.pacing = pacing;
    app.settingsChanged();
  };
  const feedback = button("segment", "Feedback", choose("feedback"));
  const media = button("segment", "Media", choose("media"));
  feedback.title = "The next command waits for the robot's answer";
  media.title =
    "The next command also waits for a fresh picture and, while you hear the robot, for fresh sound";
  const control = h("span", "segments", { role: "group", "aria-label": "Pacing" }, feedback, media);
  return {
    element: h("div", "setting", {}, h("span", "setting-label", {}, "Pace commands by"), control),
    update() {
      setPressed(feedback, app.state.settings.pacing === "feedback");
      setPressed(media, app.state.settings.pacing === "media");
    },
  };
}

function createFlag(app: ConsoleApp, label: string, name: "contactTone" | "rumble", about: string): Part {
  const { settings } = app.state;
  return createSwitch(
    app,
    label,
    about,
    () => settings[name],
    () => (settings[name] = !settings[name]),
  );
}

/** The console may have decided: then the switch shows it and cannot be turned. */
function createCap(app: ConsoleApp): Part {
  const { settings } = app.state;
  const isOn = (): boolean => capHolds(app.state.speedCap, settings.speedCap);
  const turn = (): void => void (settings.speedCap = !settings.speedCap);
  const about = "Speed limited to 0.2 s ÷ delay of the pictures";
  const part = createSwitch(app, "Slow down with delay", about, isOn, turn);
  const control = part.element.querySelector("button");
  return {
    element: part.element,
    update() {
      part.update();
      const isChoice = capIsChoice(app.state.speedCap);
      if (control !== null) control.disabled = !isChoice;
      part.element.title = isChoice ? about : `${about}. The console has set this.`;
    },
  };
}

function createGate(app: ConsoleApp): Part {
  const { settings } = app.state;
  const isOn = (): boolean => settings.gate === "event";
  const turn = (): void => void (settings.gate = isOn() ? "off" : "event");
  return createSwitch(app, "Media gate", "Off shows everything, however old", isOn, turn);
}

function createSwitch(
  app: ConsoleApp,
  label: string,
  about: string,
  isOn: () => boolean,
  turn: () => void,
): Part {
  const control = button("switch", "", () => {
    turn();
    app.settingsChanged();
  });
  control.setAttribute("role", "switch");
  control.setAttribute("aria-label", label);
  const element = h("div", "setting", { title: about }, h("span", "setting-label", {}, label), control);
  return {
    element,
    update() {
      const on = isOn();
      setData(control, "on", String(on));
      if (control.getAttribute("aria-checked") !== String(on))
        control.setAttribute("aria-checked", String(on));
    },
  };
}
