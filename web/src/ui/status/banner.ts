import type { ConsoleEngine } from "../../engine/console_engine";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";

const GATE_OFF_WORDS = { off: "Gate off", age: "Gate by clock" } as const;

/** A strip across the page for what must not be missed and does not end by itself. */
export function createBanner(engine: ConsoleEngine): Panel {
  const text = h("span", "banner-text");
  const gateOn = button("banner-button", "Turn the gate on", () => {
    engine.state.settings.gate = "event";
    engine.settingsChanged();
  });
  const element = h("div", "banner", { role: "status" }, text, gateOn);
  return {
    element,
    update() {
      const { gate } = engine.state.settings;
      const gateOff = gate !== "event";
      const words = gateOff
        ? `${GATE_OFF_WORDS[gate]}: pictures and sound may not match the robot's state`
        : coveredStop(engine);
      setHidden(element, words === null);
      setData(element, "tone", gateOff ? "hazard" : "bad");
      setText(text, words ?? "");
      setHidden(gateOn, !gateOff);
    },
  };
}

/** A stop stands over the large view; here too while something covers that. */
function coveredStop(engine: ConsoleEngine): string | null {
  if (!engine.state.stop.stopped || !engine.page.isOccupied()) return null;
  const { by, reason } = engine.state.stop;
  return `Stopped${by === "" ? "" : ` by ${by}`}${reason === "" ? "" : `: ${reason}`}`;
}
