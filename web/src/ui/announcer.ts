import { robotName } from "../core/fleet_link";
import { DISARM_WORDS } from "../core/words";
import type { ConsoleApp } from "../console_app";
import { h, setText, type Panel } from "./dom";
import { overlayWords } from "./overlay";

/** Tells screen readers, and the window's title, what changed. */
export function createAnnouncer(app: ConsoleApp): Panel {
  const polite = h("div", "", { "aria-live": "polite" });
  const page = robotName(location.href) === "" ? "Lockstep" : `${robotName(location.href)} · Lockstep`;
  const urgent = h("div", "", { "aria-live": "assertive" });
  return {
    element: h("div", "unseen", {}, polite, urgent),
    update(now) {
      const overlay = overlayWords(app, now);
      const { state, reason } = app.arming;
      const armed = state === "disarmed" ? DISARM_WORDS[reason] : state === "armed" ? "Armed" : "Driving";
      setText(polite, overlay?.tone === "stopped" ? "" : (overlay?.title ?? armed));
      setText(urgent, overlay?.tone === "stopped" ? `${overlay.title}. ${overlay.text}` : "");
      const title = overlay === null ? (app.isArmed() ? "Armed" : "") : overlay.title;
      const name = title === "" ? page : `${title} · ${page}`;
      if (document.title !== name) document.title = name;
    },
  };
}
