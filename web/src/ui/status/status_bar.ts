import { robotIsUp } from "../../session/console_state";
import { overviewPage, robotName as nameInFleet } from "../../fleet/robot_links";
import type { ConsoleEngine } from "../../engine/console_engine";
import { button, h, setData, setHidden, setPressed, setText, type Panel } from "../elements/dom";

type Tone = "good" | "wait" | "bad" | "off";

interface Chip {
  readonly element: HTMLElement;
  show(tone: Tone, text: string): void;
}

/** Name, links and sound: the top of the page. */
export function createStatusBar(engine: ConsoleEngine, toggleDetails: () => void, news: () => number): Panel {
  const robotName = h("span", "bar-robot");
  const consoleChip = createChip("Console");
  const robotChip = createChip("Robot");
  const level = h("span", "sound-level", { "aria-hidden": "true" });
  const soundText = h("span");
  const sound = button("chip-button sound", "", () => toggleSound(engine));
  sound.append(level, soundText);
  const details = button("chip-button details-button", "Details", toggleDetails);
  const badge = h("span", "tab-badge calls", {}, "");
  details.append(badge);
  const name = nameInFleet(location.href);
  // Small screens write it over the large view: the bar has no room for it.
  if (name !== "") document.documentElement.style.setProperty("--robot-name", JSON.stringify(name));
  const element = h(
    "header",
    "bar",
    {},
    ...wayBack(),
    h("h1", "unseen", {}, name === "" ? "Lockstep" : `Lockstep: ${name}`),
    h("span", "bar-brand", { "aria-hidden": "true" }, "Lockstep"),
    ...(name === "" ? [] : [h("strong", "bar-name", {}, name)]),
    robotName,
    h("div", "bar-chips", {}, consoleChip.element, robotChip.element),
    h("div", "bar-tools", {}, sound, details),
  );
  return {
    element,
    update(now) {
      setText(robotName, engine.state.robot?.description.label ?? "");
      consoleChip.show(...consoleWords(engine, now));
      robotChip.show(...robotWords(engine, now));
      setHidden(badge, news() === 0);
      setText(badge, `${news()}`);
      const audible = engine.streams.isAudible();
      setHidden(sound, engine.streams.sounds.size === 0);
      setPressed(sound, audible);
      const soundWords = audible ? "Sound on" : "Turn on sound";
      setText(soundText, soundWords);
      if (sound.ariaLabel !== soundWords) sound.ariaLabel = soundWords; // small screens show no text on it
      const loudest = Math.max(0, ...[...engine.streams.sounds.values()].map((stream) => stream.level()));
      level.style.setProperty("--level", loudest.toFixed(2));
    },
  };
}

/** To the overview, on a page that was opened from there. */
function wayBack(): HTMLElement[] {
  const href = overviewPage(location.hash, location.href);
  if (href === null) return [];
  return [h("a", "bar-back", { href }, h("span", "bar-back-words", {}, "All robots"))];
}

/** Browsers let a page make sound only after the user touched it. */
function toggleSound(engine: ConsoleEngine): void {
  const { settings } = engine.state;
  settings.soundWanted = !engine.streams.isAudible();
  if (settings.soundWanted) engine.audio.resume();
  engine.settingsChanged();
}

function createChip(label: string): Chip {
  const text = h("span", "chip-text");
  const element = h("span", "chip", {}, h("span", "chip-dot"), h("span", "chip-label", {}, label), text);
  return {
    element,
    show(tone, words) {
      setData(element, "tone", tone);
      setText(text, words);
    },
  };
}

function consoleWords(engine: ConsoleEngine, now: number): [Tone, string] {
  if (engine.connectionState.kind === "connected")
    return engine.hears(now) ? ["good", "connected"] : ["bad", "silent"];
  if (engine.connectionState.kind === "no_token") return ["off", "no link"];
  if (engine.connectionState.kind === "ended") return ["off", "closed"];
  return engine.connectionState.kind === "connecting" ? ["wait", "connecting"] : ["bad", "not connected"];
}

/** Only the console can say how the robot is. */
function robotWords(engine: ConsoleEngine, now: number): [Tone, string] {
  if (engine.state.robot === null || !engine.hears(now)) return ["off", "unknown"];
  return robotIsUp(engine.state) ? ["good", "connected"] : ["bad", "unreachable"];
}
