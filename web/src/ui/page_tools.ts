import { button, h } from "./dom";

export interface PageTools {
  charts(): void;
  keys(): void;
  pads(): void;
}

/** Buttons for what stands beside the pictures: in the bar, and on small screens in the details. */
export function createPageTools(tools: PageTools): { bar: HTMLElement; details: HTMLElement } {
  const pair = (className: string): HTMLElement => {
    const charts = button("chip-button", "Charts", () => tools.charts());
    const keys = button("chip-button", "Keys", () => tools.keys());
    const pads = button("chip-button", "Pads", () => tools.pads());
    pads.setAttribute("aria-keyshortcuts", "G");
    pads.append(h("kbd", "", {}, "G"));
    charts.setAttribute("aria-keyshortcuts", "C");
    keys.setAttribute("aria-keyshortcuts", "H");
    charts.append(h("kbd", "", {}, "C"));
    keys.append(h("kbd", "", {}, "H"));
    return h("div", className, {}, charts, pads, keys);
  };
  return { bar: pair("bar-extras"), details: pair("details-extras") };
}
