import { holdsSeat, isOperator } from "../core/console_state";
import type { ConsoleApp } from "../console_app";
import { button, h, setData, setHidden, setText, type Panel } from "./dom";

/** A strip across the page for what must not be missed and does not end by itself. */
export function createBanner(app: ConsoleApp): Panel {
  const text = h("span", "banner-text");
  const gateOn = button("banner-button", "Turn the gate on", () => {
    app.state.settings.gateEnabled = true;
    app.settingsChanged();
  });
  const take = button("banner-button", "Take control", () => app.requestSeat());
  const element = h("div", "banner", { role: "status" }, text, gateOn, take);
  return {
    element,
    update() {
      const gateOff = !app.state.settings.gateEnabled;
      const words = gateOff
        ? "Gate off: pictures and sound may not match the robot's state"
        : app.stopping.failed
          ? "The robot did not confirm the STOP: use the hardware stop"
          : roleWords(app);
      setHidden(element, words === null);
      setData(element, "tone", gateOff ? "hazard" : app.stopping.failed ? "bad" : "calm");
      setText(text, words ?? "");
      setHidden(gateOn, !gateOff);
      setHidden(take, gateOff || !isOperator(app.state) || app.state.seat?.holder !== "");
    },
  };
}

function roleWords(app: ConsoleApp): string | null {
  const { seat, welcome } = app.state;
  if (welcome === null || seat === null || holdsSeat(app.state)) return null;
  const driver = seat.holder === "" ? "Nobody drives" : `${seat.name} drives`;
  if (welcome.role === "observer") return `Watching. ${driver}. You may stop the robot at any time`;
  return seat.holder === "" ? "The control seat is free" : `${driver}: the control seat is taken`;
}
