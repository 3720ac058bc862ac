import { robotIsUp } from "../core/console_state";
import { ageWords, resumeWords } from "../core/freshness";
import { mayReset, noteShownStop, resetNews, secondsToReset, whoResets } from "../core/reset_offer";
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
  readonly warning?: string; // what makes it graver
}

const NOT_KEPT =
  "The robot could not save this stop: if it restarts, it may move again. Switch it off by its hardware stop before anyone goes near.";

/** Says over the large view what is wrong, and offers the way out. */
export function createOverlay(app: ConsoleApp): Panel {
  const title = h("strong", "plate-title");
  const text = h("p", "plate-text");
  const retry = button("wide-button", "Try now", () => app.connection.retryNow());
  const reset = holdButton("reset", (heldMs) => app.stopping.reset(heldMs, performance.now()));
  const warning = h("p", "plate-warning");
  const news = h("p", "plate-news", { role: "status" });
  const plate = h("div", "plate", {}, title, text, warning, retry, reset.element, news);
  const element = h("div", "overlay", {}, plate);
  return {
    element,
    update(now) {
      const words = overlayWords(app, now);
      setHidden(element, words === null);
      const isStop = words?.tone === "stopped";
      noteShownStop(app.stopping.offer, isStop ? app.state.stop : null, now);
      if (words === null) return;
      setData(element, "tone", words.tone);
      setText(title, words.title);
      setText(text, words.text);
      setHidden(text, words.text === "");
      setHidden(retry, app.link.kind !== "waiting");
      setText(warning, words.warning ?? "");
      setHidden(warning, words.warning === undefined);
      setHidden(reset.element, !isStop || !mayReset(app.state) || app.state.stop.locked_out !== "");
      const seconds = secondsToReset(app.stopping.offer, now);
      reset.show(seconds === 0 ? "Hold to reset" : `Look first: reset in ${seconds} s`, seconds === 0);
      const told = resetNews(app.stopping.offer, now);
      setText(news, told);
      setHidden(news, told === "");
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
  return app.state.stop.stopped || app.state.stop.locked_out !== "" ? stopWords(app, now) : null;
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

function stopWords(app: ConsoleApp, now: number): OverlayWords {
  const { by, reason, locked_out: lock } = app.state.stop;
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
  const next = mayReset(app.state) ? "Reset moves nothing; arm again afterwards." : whoResets(app.state);
  const words = { tone: "stopped", title: "Stopped", text: `${who}${why}. ${next}` } as const;
  return app.stopping.isUnkept(now) ? { ...words, warning: NOT_KEPT } : words;
}

function troubleWords(link: { why: LinkTrouble; detail: string }, next: string): OverlayWords {
  const { title, text } = TROUBLE_WORDS[link.why];
  const detail = link.detail === "" ? "" : sentence(link.detail);
  return { tone: "bad", title, text: [text, detail, next].filter((part) => part !== "").join(" ") };
}

function sentence(text: string): string {
  return `${text.charAt(0).toUpperCase()}${text.slice(1).replace(/\.?$/, ".")}`;
}
