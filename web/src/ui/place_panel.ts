import { placesOf, placeWords, type Place } from "../core/places";
import type { ConsoleApp } from "../console_app";
import type { RobotDescription } from "../wire";
import { h, setHidden, setText, type Panel } from "./dom";
import { createStaleMark } from "./stale_mark";

const MOST = 6; // rows

/** Where the joints are that are moved one by one. */
export function createPlacePanel(app: ConsoleApp): Panel {
  const rows = h("dl", "place-rows");
  const stale = createStaleMark(app);
  const name = h("span", "gauge-name", {}, "Position");
  const element = h("div", "places", { "aria-label": "Position" }, name, rows, stale.element);
  let description: RobotDescription | null = null;
  let shown: { place: Place; value: HTMLElement }[] = [];
  return {
    element,
    update(now) {
      stale.update(now);
      const found = app.state.robot?.description ?? null;
      if (found !== null && found !== description) {
        description = found;
        shown = placesOf(found)
          .slice(0, MOST)
          .map((place) => ({ place, value: h("dd", "place-value") }));
        rows.replaceChildren(
          ...shown.flatMap(({ place, value }) => [h("dt", "place-label", {}, place.label), value]),
        );
      }
      setHidden(element, shown.length === 0);
      for (const { place, value } of shown) setText(value, placeWords(place, app.state.feedback));
    },
  };
}
