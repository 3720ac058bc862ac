import { robotName } from "../../fleet/robot_links";
import { disarmLabel } from "../../drive/labels/labels";
import type { ConsoleEngine } from "../../engine/console_engine";
import { setText, type Panel } from "../elements/dom";
import { overlayLabels } from "../views/overlay";

/** Tells screen readers, by live regions that the page has from its start, and the window's title what changed. */
export function createAnnouncer(engine: ConsoleEngine, polite: HTMLElement, urgent: HTMLElement): Panel {
  const page = robotName(location.href) === "" ? "Lockstep" : `${robotName(location.href)} · Lockstep`;
  return {
    element: polite,
    update(now) {
      const overlay = overlayLabels(engine, now);
      const { state, reason } = engine.driving.arming;
      const armed = state === "disarmed" ? disarmLabel(reason) : state === "armed" ? "Armed" : "Driving";
      setText(polite, overlay?.tone === "stopped" ? "" : (overlay?.title ?? armed));
      setText(urgent, overlay?.tone === "stopped" ? `${overlay.title}. ${overlay.text}` : "");
      const title = overlay === null ? (engine.driving.isArmed() ? "Armed" : "") : overlay.title;
      const name = title === "" ? page : `${title} · ${page}`;
      if (document.title !== name) document.title = name;
    },
  };
}
