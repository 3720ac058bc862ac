import { crowdWords, personWords, sortPeople, summarise, type People } from "../core/people";
import { mayDrive } from "../core/console_state";
import type { ConsoleApp } from "../console_app";
import type { Participant } from "../wire";
import { button, h, setHidden, setText, type Panel } from "./dom";
import { createRenameForm } from "./rename_form";

/** So few observers are shown without being asked for. */
const FEW = 6;

/** What else can be done about people, in dialogues. */
export interface PeopleTools {
  invite(): void;
  audit(): void;
}

/** Who is here, and how each of them does. */
export function createPeoplePanel(app: ConsoleApp, tools: PeopleTools): Panel {
  const leading = h("ul", "people");
  const crowd = h("span", "crowd-words");
  const watching = h("ul", "people");
  const toggle = button("quiet-button", "Show all", () => {
    open = !open;
    shown = "";
  });
  const crowdHead = h("div", "crowd", {}, crowd, toggle);
  const empty = h("p", "muted", {}, "Nobody is connected");
  const rename = createRenameForm(app);
  const invite = button("field-button", "Invite…", () => tools.invite());
  const audit = button("field-button quiet", "Audit trail…", () => tools.audit());
  const toolRow = h("div", "people-tools", {}, invite, audit);
  let open = false;
  let shown = "";
  return {
    element: h(
      "section",
      "people-panel",
      { "aria-label": "People" },
      toolRow,
      empty,
      leading,
      rename,
      crowdHead,
      watching,
    ),
    update() {
      const { participants, seat, welcome } = app.state;
      setHidden(toolRow, !mayDrive(app.state));
      setHidden(audit, welcome?.role !== "supervisor");
      const key = JSON.stringify([
        participants,
        seat?.holder,
        seat?.claims.map((claim) => claim.peer),
        welcome?.peer,
      ]);
      if (key === shown) return;
      shown = key;
      const people = sortPeople(participants, seat, welcome?.peer ?? null);
      setHidden(empty, participants.length > 0);
      setHidden(rename, welcome === null);
      leading.replaceChildren(...people.leading.map((person) => personLine(app, person)));
      showCrowd(people);
    },
  };

  function showCrowd({ watching: crowded }: People): void {
    const all = open || crowded.length <= FEW;
    setHidden(crowdHead, crowded.length === 0);
    setText(crowd, crowdWords(summarise(crowded)));
    setHidden(toggle, crowded.length <= FEW);
    setText(toggle, open ? "Show few" : "Show all");
    const rows = all ? crowded : crowded.slice(0, FEW);
    watching.replaceChildren(...rows.map((person) => personLine(app, person)));
  }
}

function personLine(app: ConsoleApp, person: Participant): HTMLElement {
  const { seat, welcome } = app.state;
  const name = h("span", "person-name", {}, person.name);
  const line = h("span", "person-line", {}, name);
  if (person.peer === welcome?.peer) line.append(h("span", "person-tag you", {}, "you"));
  if (person.peer === seat?.holder) line.append(h("span", "person-tag drives", {}, "drives"));
  else if (seat?.claims.some((claim) => claim.peer === person.peer) === true)
    line.append(h("span", "person-tag asks", {}, "asks for control"));
  return h(
    "li",
    "person",
    {},
    line,
    h("span", "person-role", {}, person.role),
    h("span", "person-figures", {}, personWords(person)),
  );
}
