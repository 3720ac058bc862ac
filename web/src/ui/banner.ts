import type { ConsoleApp } from "../console_app";
import { button, h, setData, setHidden, setText, type Panel } from "./dom";

const GATE_OFF_WORDS = { off: "Gate off", age: "Gate by clock" } as const;

/** A strip across the page for what must not be missed and does not end by itself. */
export function createBanner(app: ConsoleApp): Panel {
  const text = h("span", "banner-text");
  const gateOn = button("banner-button", "Turn the gate on", () => {
    app.state.settings.gate = "event";
    app.settingsChanged();
  });
  const element = h("div", "banner", { role: "status" }, text, gateOn);
  return {
    element,
    update() {
      const { gate } = app.state.settings;
      const gateOff = gate !== "event";
      const words = gateOff
        ? `${GATE_OFF_WORDS[gate]}: pictures and sound may not match the robot's state`
        : coveredStop(app);
      setHidden(element, words === null);
      setData(element, "tone", gateOff ? "hazard" : "bad");
      setText(text, words ?? "");
      setHidden(gateOn, !gateOff);
    },
  };
}

/** A stop stands over the large view; here too while something covers that. */
function coveredStop(app: ConsoleApp): string | null {
  if (!app.state.stop.stopped || !app.page.isOccupied()) return null;
  const { by, reason } = app.state.stop;
  return `Stopped${by === "" ? "" : ` by ${by}`}${reason === "" ? "" : `: ${reason}`}`;
}
