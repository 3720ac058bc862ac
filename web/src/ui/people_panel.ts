import { holdsSeat, isOperator } from "../core/console_state";
import type { ConsoleApp } from "../console_app";
import type { Participant } from "../wire";
import { button, h, milliseconds, setHidden, setText, type Panel } from "./dom";

/** Who is here, and who may drive. */
export function createPeoplePanel(app: ConsoleApp): Panel {
  const count = h("span", "card-note");
  const list = h("ul", "people");
  const take = button("wide-button", "Take control", () => app.requestSeat());
  const release = button("wide-button quiet", "Give control back", () => app.releaseSeat());
  const head = h("div", "card-head", {}, h("h2", "", {}, "People"), count);
  let shown = "";
  return {
    element: h("section", "card", { "aria-label": "People" }, head, list, take, release),
    update() {
      const { participants, seat } = app.state;
      const mine = holdsSeat(app.state);
      setText(count, String(participants.length));
      setHidden(take, !isOperator(app.state) || mine || seat?.holder !== "");
      setHidden(release, !mine);
      const key = JSON.stringify([participants, seat?.holder, app.state.welcome?.peer]);
      if (key === shown) return;
      shown = key;
      list.replaceChildren(...participants.map((person) => personLine(app, person)));
    },
  };
}

function personLine(app: ConsoleApp, person: Participant): HTMLElement {
  const isYou = person.peer === app.state.welcome?.peer;
  const drives = person.peer === app.state.seat?.holder;
  const delay = person.picture_delay_ms === null ? "" : `${milliseconds(person.picture_delay_ms)} ms`;
  return h(
    "li",
    drives ? "person drives" : "person",
    {},
    h("span", "person-name", {}, isYou ? `${person.name} (you)` : person.name),
    h("span", "person-role", {}, drives ? "drives" : person.role),
    h("span", "person-delay", {}, delay),
  );
}
