import type { ReplayMark } from "../index_table";
import { button, h, setData, setHidden, setPressed, setText } from "../../ui/elements/dom";
import type { Player } from "../player";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const FIELDS = "input, textarea, select";

export interface PlaybackControls {
  readonly element: HTMLElement;
  update(): void;
  key(event: KeyboardEvent): boolean; // true: it was one of the player's
}

/** Play, step, jump, loop and speed. `marks`: those that are shown. */
export function createPlaybackControls(player: Player, marks: () => readonly ReplayMark[]): PlaybackControls {
  const toggle = (): void => (player.isPlaying ? player.pause() : player.play());
  const tool = (text: string, name: string, keys: string, act: () => void): HTMLButtonElement => {
    const element = button("transport-button", text, act);
    element.setAttribute("aria-label", name);
    element.title = `${name} (${keys})`;
    return element;
  };
  const play = tool("", "Play", "space", toggle);
  play.classList.add("play");
  const speed = h("select", "field transport-speed", { "aria-label": "Speed" });
  for (const each of SPEEDS) speed.append(h("option", "", { value: String(each) }, `${each}×`));
  speed.value = "1";
  speed.addEventListener("change", () => {
    player.speed = Number(speed.value);
    speed.blur();
  });
  const loop = tool("Loop", "Loop between A and B", "L", () => toggleLoop(player));
  const from = tool("A", "Loop from this event", "[", () => setLoop(player, "from"));
  const to = tool("B", "Loop to this event", "]", () => setLoop(player, "to"));
  const newest = button("chip-button newest", "Newest", () => player.toNewest());
  const busy = h("span", "transport-busy", { role: "status" });
  const element = h(
    "div",
    "transport",
    { role: "group", "aria-label": "Playback" },
    tool("|◂", "Jump to the mark before", "Shift ←", () => player.jump(marks(), -1)),
    tool("◂", "One event back", "←", () => void player.step(-1)),
    play,
    tool("▸", "One event on", "→", () => void player.step(1)),
    tool("▸|", "Jump to the next mark", "Shift →", () => player.jump(marks(), 1)),
    h("span", "transport-group", {}, from, loop, to),
    speed,
    busy,
    newest,
  );
  const keys: Readonly<Record<string, () => void>> = {
    ArrowLeft: () => void player.step(-1),
    ArrowRight: () => void player.step(1),
    "Shift+ArrowLeft": () => player.jump(marks(), -1),
    "Shift+ArrowRight": () => player.jump(marks(), 1),
    " ": toggle,
    Home: () => void player.seek(player.index.firstEvent),
    End: () => void player.seek(player.index.lastEvent),
    l: () => toggleLoop(player),
    "[": () => setLoop(player, "from"),
    "]": () => setLoop(player, "to"),
  };
  return {
    element,
    update() {
      setText(play, player.isPlaying ? "❚❚" : "▶");
      play.setAttribute("aria-label", player.isPlaying ? "Pause" : "Play");
      setPressed(loop, player.loop !== null);
      setHidden(newest, !player.isRunning);
      setPressed(newest, player.follows);
      setText(newest, player.follows ? "At the newest" : "To the newest");
      setText(busy, player.isLoading && !player.isPlaying ? "Loading …" : "");
      setData(element, "playing", String(player.isPlaying));
    },
    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return false;
      if (event.target instanceof Element && event.target.matches(FIELDS)) return false;
      if (event.key === " " && event.target instanceof HTMLButtonElement) return false; // it presses that
      const act = keys[event.shiftKey && event.key.startsWith("Arrow") ? `Shift+${event.key}` : event.key];
      act?.();
      return act !== undefined;
    },
  };
}

function toggleLoop(player: Player): void {
  const { firstEvent: from, lastEvent: to } = player.index;
  player.loop = player.loop === null ? { from, to } : null;
  player.changed();
}

function setLoop(player: Player, edge: "from" | "to"): void {
  player.loop = player.loopWith(edge, player.place.event);
  player.changed();
}
