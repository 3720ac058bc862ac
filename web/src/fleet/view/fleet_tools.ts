import type { FleetSorting } from "../robot_order";
import { button, h, setPressed } from "../../ui/elements/dom";

export interface FleetTools {
  readonly element: HTMLElement;
  readonly query: string; // what the names are filtered by
  readonly sorting: FleetSorting;
  clear(): void;
}

const KEPT = "lockstep.fleet.sorting";

/** Filter and order of the tiles. The order is kept in this browser, the filter is not: it would hide robots. */
export function createFleetTools(changed: () => void): FleetTools {
  let sorting = keptSorting();
  const field = h("input", "field fleet-filter", {
    type: "search",
    placeholder: "Filter by name",
    "aria-label": "Filter robots by name",
    autocomplete: "off",
    spellcheck: "false",
  });
  const choices = [
    ["trouble", "Trouble first"],
    ["name", "By name"],
  ] as const;
  const buttons = choices.map(([value, label]) => button("segment", label, () => choose(value)));
  const show = (): void => {
    for (const [index, [value]] of choices.entries()) {
      const each = buttons[index];
      if (each !== undefined) setPressed(each, value === sorting);
    }
  };
  const choose = (value: FleetSorting): void => {
    sorting = value;
    keepSorting(value);
    show();
    changed();
  };
  field.addEventListener("input", changed);
  show();
  const order = h("div", "segments fleet-order", { role: "group", "aria-label": "Order" }, ...buttons);
  return {
    element: h("div", "fleet-tools", {}, field, order),
    get query() {
      return field.value;
    },
    get sorting() {
      return sorting;
    },
    clear() {
      field.value = "";
      changed();
    },
  };
}

/** A browser that keeps nothing for this page has the usual order. */
function keptSorting(): FleetSorting {
  try {
    return localStorage.getItem(KEPT) === "name" ? "name" : "trouble";
  } catch {
    return "trouble";
  }
}

function keepSorting(sorting: FleetSorting): void {
  try {
    localStorage.setItem(KEPT, sorting);
  } catch {
    // It holds until the page is closed.
  }
}
