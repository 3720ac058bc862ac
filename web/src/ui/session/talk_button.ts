import type { ConsoleEngine } from "../../engine/console_engine";
import { keyName } from "../../input/shortcuts";
import { TALK_KEY, type Talkback } from "../../talkback/talkback";
import { h, setData, setHidden, setText, svg, type Panel } from "../elements/dom";

/** Hold to talk, with the level of what is heard of it; and for everyone, who speaks. */
export function createTalkButton(engine: ConsoleEngine, voice: Talkback): Panel {
  const label = h("span", "talk-label");
  const key = h("kbd", "seat-key", {}, keyName(TALK_KEY));
  const level = h("span", "talk-level", { "aria-hidden": "true" });
  const button = h("button", "seat-button talk", { type: "button" }, level, microphone(), label, key);
  const speaker = h("span", "talk-speaker", { role: "status" });
  const element = h("div", "talk-panel", {}, speaker, button);
  holding(voice, button);
  return {
    element,
    update() {
      const { talk } = voice;
      const obstacle = voice.obstacle();
      const mine = engine.state.voice?.peer === engine.state.welcome?.peer;
      const offered = voice.isOffered();
      setHidden(button, !offered || (obstacle !== null && !talk.talking && !holdsOwnTrouble(engine)));
      setHidden(key, voice.keyDrives());
      button.title = obstacle ?? "Your voice is heard at the robot while you hold this button";
      button.disabled = obstacle !== null;
      setData(button, "talk", talk.talking ? "on" : talk.microphone);
      setText(label, words(engine, voice, mine));
      level.style.setProperty("--level", voice.level().toFixed(2));
      const name = engine.state.voice?.name ?? "";
      setHidden(speaker, mine || (engine.state.voice?.peer ?? "") === "");
      setText(speaker, `${name} is speaking`);
    },
  };
}

/** Who has control and cannot be heard is told so; for the others there is no button. */
function holdsOwnTrouble(engine: ConsoleEngine): boolean {
  const { seat, welcome, voice } = engine.state;
  return seat !== null && seat.holder === welcome?.peer && (voice?.trouble ?? "") !== "";
}

function words(engine: ConsoleEngine, voice: Talkback, heard: boolean): string {
  const { talk } = voice;
  if ((engine.state.voice?.trouble ?? "") !== "") return "No loudspeaker";
  if (talk.talking) return heard ? "You are heard" : "Talking…";
  if (talk.microphone === "asking") return "Allow the microphone";
  return "Hold to talk";
}

/** Keeps no focus: the space bar is the deadman and must not press it. */
function holding(voice: Talkback, button: HTMLButtonElement): void {
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    voice.press();
  });
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"])
    button.addEventListener(type, () => {
      voice.release();
      button.blur();
    });
  button.addEventListener("keydown", (event) => {
    if (event.code === "Enter" && !event.repeat) voice.press();
  });
  for (const type of ["keyup", "blur"]) button.addEventListener(type, () => voice.release());
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}

function microphone(): SVGElement {
  const icon = svg("svg", { viewBox: "0 0 16 16", class: "talk-icon", "aria-hidden": "true" });
  icon.append(
    svg("rect", { x: "5.5", y: "1", width: "5", height: "9", rx: "2.5", fill: "currentColor" }),
    svg("path", {
      d: "M3 7.5a5 5 0 0 0 10 0M8 12.5V15M5.5 15h5",
      fill: "none",
      stroke: "currentColor",
      "stroke-width": "1.5",
      "stroke-linecap": "round",
    }),
  );
  return icon;
}
