import { capHolds, capIsChoice } from "../../drive/speed_cap";
import type { Settings } from "../../session/console_state";
import type { ConsoleEngine } from "../../engine/console_engine";
import { button, h, setData, setHidden, setPressed, setText, type Panel } from "../elements/dom";

const MAX_TOLERANCE = 99;

type Part = { readonly element: HTMLElement; update(): void };

/** Tolerances, pacing, and the gate itself. */
export function createSettingsPanel(engine: ConsoleEngine): Panel {
  const parts: Part[] = [
    createStepper(engine, "Picture tolerance", "video"),
    createStepper(engine, "Sound tolerance", "audio"),
    createPacing(engine),
    createCap(engine),
    createFlag(engine, "Rumble", "rumble", "The gamepad rumbles with the force, while armed"),
    createFlag(engine, "Contact tone", "contactTone", "A tone that rises with the force"),
    createFrames(engine),
    createGate(engine),
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

function createStepper(engine: ConsoleEngine, label: string, kind: "audio" | "video"): Part {
  const value = h("output", "stepper-value");
  const step = (by: number) => (): void => {
    const { tolerance } = engine.state.settings;
    tolerance[kind] = Math.min(MAX_TOLERANCE, Math.max(0, tolerance[kind] + by));
    engine.settingsChanged();
  };
  const less = button("stepper-button", "−", step(-1));
  const more = button("stepper-button", "+", step(1));
  less.setAttribute("aria-label", `${label}: one event less`);
  more.setAttribute("aria-label", `${label}: one event more`);
  const control = h("span", "stepper", {}, less, value, more);
  return {
    element: h("div", "setting", {}, h("span", "setting-label", {}, label), control),
    update: () => setText(value, String(engine.state.settings.tolerance[kind])),
  };
}

function createPacing(engine: ConsoleEngine): Part {
  const choose = (pacing: Settings["pacing"]) => (): void => {
    engine.state.settings.pacing = pacing;
    engine.settingsChanged();
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
      setPressed(feedback, engine.state.settings.pacing === "feedback");
      setPressed(media, engine.state.settings.pacing === "media");
    },
  };
}

function createFlag(
  engine: ConsoleEngine,
  label: string,
  name: "contactTone" | "rumble",
  about: string,
): Part {
  const { settings } = engine.state;
  return createSwitch(
    engine,
    label,
    about,
    () => settings[name],
    () => (settings[name] = !settings[name]),
  );
}

/** The console may have decided: then the switch shows it and cannot be turned. */
function createCap(engine: ConsoleEngine): Part {
  const { settings } = engine.state;
  const isOn = (): boolean => capHolds(engine.state.speedCap, settings.speedCap);
  const turn = (): void => void (settings.speedCap = !settings.speedCap);
  const about = "Speed limited to 0.2 s ÷ delay of the pictures";
  const part = createSwitch(engine, "Slow down with delay", about, isOn, turn);
  const control = part.element.querySelector("button");
  return {
    element: part.element,
    update() {
      part.update();
      const isChoice = capIsChoice(engine.state.speedCap);
      if (control !== null) control.disabled = !isChoice;
      part.element.title = isChoice ? about : `${about}. The console has set this.`;
    },
  };
}

/** Of robots that have tools and a camera whose place is known. */
function createFrames(engine: ConsoleEngine): Part {
  const part = createSwitch(
    engine,
    "Tool frames",
    "Frames of the tools on the pictures: as measured, and dashed where they are to be (key P)",
    () => engine.streams.overlay?.isOn === true,
    () => engine.streams.overlay?.toggle(),
  );
  part.element.querySelector("button")?.setAttribute("aria-keyshortcuts", "P");
  return {
    element: part.element,
    update() {
      const description = engine.state.robot?.description;
      const canDraw =
        description !== undefined &&
        description.poses.length > 0 &&
        description.cameras.some(({ calibration }) => calibration !== null);
      setHidden(part.element, !canDraw);
      part.update();
    },
  };
}

function createGate(engine: ConsoleEngine): Part {
  const { settings } = engine.state;
  const isOn = (): boolean => settings.gate === "event";
  const turn = (): void => void (settings.gate = isOn() ? "off" : "event");
  return createSwitch(engine, "Media gate", "Off shows everything, however old", isOn, turn);
}

function createSwitch(
  engine: ConsoleEngine,
  label: string,
  about: string,
  isOn: () => boolean,
  turn: () => void,
): Part {
  const control = button("switch", "", () => {
    turn();
    engine.settingsChanged();
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
