import { mayDrive, robotIsUp } from "../core/console_state";
import { ageWords, resumeWords } from "../core/freshness";
import { END_WORDS, TROUBLE_WORDS, type LinkTrouble } from "../core/trouble";
import type { ConsoleApp } from "../console_app";
import type { LinkState } from "../rtc/connection";
import { button, h, setData, setHidden, setText, type Panel } from "./dom";
import { holdButton } from "./hold_button";

/** What stands over the large view. `tone` says how grave it is. */
export interface OverlayWords {
  readonly tone: "calm" | "bad" | "stopped";
  readonly title: string;
  readonly text: string;
}

/** Says over the large view what is wrong, and offers the way out. */
export function createOverlay(app: ConsoleApp): Panel {
  const title = h("strong", "plate-title");
  const text = h("p", "plate-text");
  const retry = button("wide-button", "Try now", () => app.connection.retryNow());
  const reset = holdButton("reset", "Hold to reset", () => app.reset());
  const plate = h("div", "plate", {}, title, text, retry, reset);
  const element = h("div", "overlay", {}, plate);
  return {
    element,
    update(now) {
      const words = overlayWords(app, now);
      setHidden(element, words === null);
      if (words === null) return;
      setData(element, "tone", words.tone);
      setText(title, words.title);
      setText(text, words.text);
      setHidden(text, words.text === "");
      setHidden(retry, app.link.kind !== "waiting");
      setHidden(reset, words.tone !== "stopped" || !mayDrive(app.state));
    },
  };
}

export function overlayWords(app: ConsoleApp, now: number): OverlayWords | null {
  if (app.link.kind !== "connected") return linkWords(app.link, now);
  if (!app.hears(now)) return silentWords(app, now);
  if (app.state.robot !== null && !robotIsUp(app.state)) {
    const { detail } = app.state.robot;
    return {
      tone: "bad",
      title: "Robot unreachable",
      text: `${detail === "" ? "" : `${sentence(detail)} `}The console keeps trying. Look after the robot and its bridge.`,
    };
  }
  return app.state.stop.stopped ? stopWords(app) : null;
}

function linkWords(link: LinkState, now: number): OverlayWords {
  switch (link.kind) {
    case "no_token":
      return {
        tone: "calm",
        title: "Open the link",
        text: "This page needs the link that lockstep up printed: it ends in #token=…",
      };
    case "connecting":
      if (link.after === undefined) return { tone: "calm", title: "Connecting…", text: "" };
      return troubleWords(link.after, "Trying again now.");
    case "waiting": {
      const seconds = Math.max(0, Math.ceil((link.retryAtMs - now) / 1000));
      return troubleWords(link, `Trying again in ${seconds} s.`);
    }
    case "ended":
      return { tone: "calm", ...END_WORDS[link.why] };
    case "connected":
      return { tone: "calm", title: "Connected", text: "" };
  }
}

/** A robot that is stopped stays so, whatever becomes of the connection. */
function silentWords(app: ConsoleApp, now: number): OverlayWords {
  const since = ageWords(app.silentMs(now));
  const stopped = app.state.stop.stopped ? " The robot was stopped when it was last heard." : "";
  const text = `Nothing was heard for ${since}. ${resumeWords(app.connection.resume.phase)}${stopped}`;
  return { tone: "bad", title: "Console silent", text };
}

function stopWords(app: ConsoleApp): OverlayWords {
  const { by, reason } = app.state.stop;
  const who = by === "" ? "The robot was stopped" : `By ${by}`;
  const why = reason === "" ? "" : `: ${reason}`;
  const next = mayDrive(app.state)
    ? "Reset moves nothing; arm again afterwards."
    : "An operator or a supervisor can reset it.";
  return { tone: "stopped", title: "Stopped", text: `${who}${why}. ${next}` };
}

function troubleWords(link: { why: LinkTrouble; detail: string }, next: string): OverlayWords {
  const { title, text } = TROUBLE_WORDS[link.why];
  const detail = link.detail === "" ? "" : sentence(link.detail);
  return { tone: "bad", title, text: [text, detail, next].filter((part) => part !== "").join(" ") };
}

function sentence(text: string): string {
  return `${text.charAt(0).toUpperCase()}${text.slice(1).replace(/\.?$/, ".")}`;
}
