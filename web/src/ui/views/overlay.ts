import { robotIsUp } from "../../session/console_state";
import { ageLabel } from "../../drive/feedback_age";
import { reconnectLabel } from "../../transport/reconnect";
import { mayReset, noteShownStop, resetMessage, secondsToReset, whoResets } from "../../stop/reset_state";
import {
  CONNECTION_END_LABELS,
  CONNECTION_ERROR_LABELS,
  type ConnectionErrorKind,
} from "../../transport/connection_error";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { ConnectionState } from "../../transport/connection";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";
import { holdButton } from "../elements/hold_button";

/** What stands over the large view. `tone` says how grave it is. */
export interface OverlayLabels {
  readonly tone: "calm" | "bad" | "stopped";
  readonly title: string;
  readonly text: string;
  readonly warning?: string; // what makes it graver
}

const NOT_KEPT =
  "The robot could not save this stop: if it restarts, it may move again. Switch it off with its hardware stop before anyone goes near.";

/** Says over the large view what is wrong, and offers the way out. */
export function createOverlay(engine: ConsoleEngine): Panel {
  const title = h("strong", "plate-title");
  const text = h("p", "plate-text");
  const retry = button("wide-button", "Try now", () => engine.connection.retryNow());
  const reset = holdButton("reset", (heldMs) => engine.stopping.reset(heldMs, performance.now()));
  const warning = h("p", "plate-warning");
  const news = h("p", "plate-news", { role: "status" });
  const plate = h("div", "plate", {}, title, text, warning, retry, reset.element, news);
  const element = h("div", "overlay", {}, plate);
  return {
    element,
    update(now) {
      const words = overlayLabels(engine, now);
      setHidden(element, words === null);
      const isStop = words?.tone === "stopped";
      noteShownStop(engine.stopping.resetState, isStop ? engine.state.stop : null, now);
      if (words === null) return;
      setData(element, "tone", words.tone);
      setText(title, words.title);
      setText(text, words.text);
      setHidden(text, words.text === "");
      setHidden(retry, engine.connectionState.kind !== "waiting");
      setText(warning, words.warning ?? "");
      setHidden(warning, words.warning === undefined);
      setHidden(reset.element, !isStop || !mayReset(engine.state) || engine.state.stop.locked_out !== "");
      const seconds = secondsToReset(engine.stopping.resetState, now);
      reset.show(seconds === 0 ? "Hold to reset" : `Look first: reset in ${seconds} s`, seconds === 0);
      const told = resetMessage(engine.stopping.resetState, now);
      setText(news, told);
      setHidden(news, told === "");
    },
  };
}

export function overlayLabels(engine: ConsoleEngine, now: number): OverlayLabels | null {
  if (engine.connectionState.kind !== "connected") return linkWords(engine.connectionState, now);
  if (!engine.hears(now)) return silentWords(engine, now);
  if (engine.state.robot !== null && !robotIsUp(engine.state)) {
    const { detail } = engine.state.robot;
    return {
      tone: "bad",
      title: "Robot unreachable",
      text: `${detail === "" ? "" : `${sentence(detail)} `}The console keeps trying. Check the robot and its bridge.`,
    };
  }
  return engine.state.stop.stopped || engine.state.stop.locked_out !== "" ? stopWords(engine, now) : null;
}

function linkWords(link: ConnectionState, now: number): OverlayLabels {
  switch (link.kind) {
    case "no_token":
      return {
        tone: "calm",
        title: "Open the link",
        text: "This page needs the link that lockstep up printed. The link ends in #token=…",
      };
    case "connecting":
      if (link.after === undefined) return { tone: "calm", title: "Connecting…", text: "" };
      return troubleWords(link.after, "Trying again now.");
    case "waiting": {
      const seconds = Math.max(0, Math.ceil((link.retryAtMs - now) / 1000));
      return troubleWords(link, `Trying again in ${seconds} s.`);
    }
    case "ended":
      return { tone: "calm", ...CONNECTION_END_LABELS[link.why] };
    case "connected":
      return { tone: "calm", title: "Connected", text: "" };
  }
}

/** A robot that is stopped stays so, whatever becomes of the connection. */
function silentWords(engine: ConsoleEngine, now: number): OverlayLabels {
  const since = ageLabel(now - engine.heardMs);
  const stopped = engine.state.stop.stopped ? " The robot was stopped when it was last heard." : "";
  const text = `The console has been silent for ${since}. ${reconnectLabel(engine.connection.reconnect.phase)}${stopped}`;
  return { tone: "bad", title: "Console silent", text };
}

function stopWords(engine: ConsoleEngine, now: number): OverlayLabels {
  const { by, reason, locked_out: lock } = engine.state.stop;
  if (lock !== "") {
    const next = "Nobody can drive or reset it from a page until that person unlocks it.";
    return {
      tone: "stopped",
      title: "Locked",
      text: `Somebody at the robot has locked it: ${lock}. ${next}`,
    };
  }
  const who = by === "" ? "The robot was stopped" : `By ${by}`;
  const why = reason === "" ? "" : `: ${reason}`;
  const next = mayReset(engine.state)
    ? "Reset moves nothing; arm again afterwards."
    : whoResets(engine.state);
  const words = { tone: "stopped", title: "Stopped", text: `${who}${why}. ${next}` } as const;
  return engine.stopping.isUnkept(now) ? { ...words, warning: NOT_KEPT } : words;
}

function troubleWords(link: { why: ConnectionErrorKind; detail: string }, next: string): OverlayLabels {
  const { title, text } = CONNECTION_ERROR_LABELS[link.why];
  const detail = link.detail === "" ? "" : sentence(link.detail);
  return { tone: "bad", title, text: [text, detail, next].filter((part) => part !== "").join(" ") };
}

function sentence(text: string): string {
  return `${text.charAt(0).toUpperCase()}${text.slice(1).replace(/\.?$/, ".")}`;
}
