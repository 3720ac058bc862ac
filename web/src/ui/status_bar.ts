import { robotIsUp } from "../core/console_state";
import { overviewPage, robotName as nameInFleet } from "../core/fleet_link";
import type { ConsoleApp } from "../console_app";
import { button, h, setData, setHidden, setPressed, setText, type Panel } from "./dom";

type Tone = "good" | "wait" | "bad" | "off";

interface Chip {
  readonly element: HTMLElement;
  show(tone: Tone, text: string): void;
}

/** Name, links and sound: the top of the page. */
export function createStatusBar(app: ConsoleApp, toggleDetails: () => void, news: () => number): Panel {
  const robotName = h("span", "bar-robot");
  const consoleChip = createChip("Console");
  const robotChip = createChip("Robot");
  const level = h("span", "sound-level", { "aria-hidden": "true" });
  const soundText = h("span");
  const sound = button("chip-button sound", "", () => toggleSound(app));
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
      setText(robotName, app.state.robot?.description.label ?? "");
      consoleChip.show(...consoleWords(app, now));
      robotChip.show(...robotWords(app, now));
      setHidden(badge, news() === 0);
      setText(badge, `${news()}`);
      const audible = app.room.isAudible();
      setHidden(sound, app.room.sounds.size === 0);
      setPressed(sound, audible);
      const soundWords = audible ? "Sound on" : "Turn on sound";
      setText(soundText, soundWords);
      if (sound.ariaLabel !== soundWords) sound.ariaLabel = soundWords; // small screens show no text on it
      const loudest = Math.max(0, ...[...app.room.sounds.values()].map((stream) => stream.level()));
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
function toggleSound(app: ConsoleApp): void {
  const { settings } = app.state;
  settings.soundWanted = !app.room.isAudible();
  if (settings.soundWanted) app.audio.resume();
  app.settingsChanged();
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

function consoleWords(app: ConsoleApp, now: number): [Tone, string] {
  if (app.link.kind === "connected") return app.hears(now) ? ["good", "connected"] : ["bad", "silent"];
  if (app.link.kind === "no_token") return ["off", "no link"];
  if (app.link.kind === "ended") return ["off", "closed"];
  return app.link.kind === "connecting" ? ["wait", "connecting"] : ["bad", "not connected"];
}

/** Only the console can say how the robot is. */
function robotWords(app: ConsoleApp, now: number): [Tone, string] {
  if (app.state.robot === null || !app.hears(now)) return ["off", "unknown"];
  return robotIsUp(app.state) ? ["good", "connected"] : ["bad", "unreachable"];
}
