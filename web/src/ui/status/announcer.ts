import { robotName } from "../../fleet/robot_links";
import { disarmLabel } from "../../drive/labels";
import type { ConsoleEngine } from "../../engine/console_engine";
import { h, setText, type Panel } from "../elements/dom";
import { overlayLabels } from "../views/overlay";

/** Tells screen readers, and the window's title, what changed. */
export function createAnnouncer(engine: ConsoleEngine): Panel {
  const polite = h("div", "", { "aria-live": "polite" });
  const page = robotName(location.href) === "" ? "Lockstep" : `${robotName(location.href)} · Lockstep`;
  const urgent = h("div", "", { "aria-live": "assertive" });
  return {
    element: h("div", "unseen", {}, polite, urgent),
    update(now) {
      const overlay = overlayLabels(engine, now);
      const { state, reason } = engine.arming;
      const armed = state === "disarmed" ? disarmLabel(reason) : state === "armed" ? "Armed" : "Driving";
      setText(polite, overlay?.tone === "stopped" ? "" : (overlay?.title ?? armed));
      setText(urgent, overlay?.tone === "stopped" ? `${overlay.title}. ${overlay.text}` : "");
      const title = overlay === null ? (engine.isArmed() ? "Armed" : "") : overlay.title;
      const name = title === "" ? page : `${title} · ${page}`;
      if (document.title !== name) document.title = name;
    },
  };
}
