import type { ConsoleEngine } from "../../engine/console_engine";
import { button, h, setHidden, setPressed } from "../elements/dom";

export interface PageToolEvents {
  charts(): void;
  keys(): void;
  pads(): void;
  scene(): void; // shows or hides it
  map(): void; // the same
  headset(className: string): HTMLButtonElement[]; // made anew for each place
}

export interface PageTools {
  readonly bar: HTMLElement;
  readonly details: HTMLElement;
  update(engine: ConsoleEngine, showsScene: boolean, showsMap: boolean): void;
}

/** Buttons for what stands beside the pictures: in the bar, and on small screens in the details. */
export function createPageTools(events: PageToolEvents): PageTools {
  const scenes: HTMLButtonElement[] = [];
  const maps: HTMLButtonElement[] = [];
  const group = (className: string): HTMLElement => {
    const scene = button("chip-button", "3D scene", () => events.scene());
    setHidden(scene, true);
    scenes.push(scene);
    const map = button("chip-button", "Map", () => events.map());
    setHidden(map, true);
    maps.push(map);
    const charts = button("chip-button", "Charts", () => events.charts());
    const keys = button("chip-button", "Keys", () => events.keys());
    const pads = button("chip-button", "Pads", () => events.pads());
    pads.setAttribute("aria-keyshortcuts", "G");
    pads.append(h("kbd", "", {}, "G"));
    charts.setAttribute("aria-keyshortcuts", "C");
    keys.setAttribute("aria-keyshortcuts", "H");
    charts.append(h("kbd", "", {}, "C"));
    keys.append(h("kbd", "", {}, "H"));
    return h("div", className, {}, ...events.headset("chip-button"), map, scene, charts, pads, keys);
  };
  return {
    bar: group("bar-extras"),
    details: group("details-extras"),
    update(engine, showsScene, showsMap) {
      const { robot } = engine.state;
      for (const scene of scenes) {
        if (robot !== null) setHidden(scene, robot.description.bodies.length === 0);
        setPressed(scene, showsScene);
      }
      for (const map of maps) {
        if (robot !== null) setHidden(map, robot.description.map === null);
        setPressed(map, showsMap);
      }
    },
  };
}
