import { mayDrive } from "../../session/console_state";
import { crowdLabel, sortParticipants, summarise } from "../../session/participants";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { Participant } from "../../protocol/wire";
import { button, h, setHidden, setText, type Panel } from "../elements/dom";
import { createParticipantRow, type ParticipantRow } from "./participant_row";
import { createRenameForm } from "./rename_form";

/** So few observers are shown without being asked for. */
const FEW = 6;

/** What else can be done about people, in dialogues. */
export interface ParticipantsTools {
  invite(): void;
  audit(): void;
  recordings(): void;
  episodes(): void;
  /** The dialogue of a robot that dials in; null while this person has none. */
  robotLink(): (() => void) | null;
}

/** Who is here, and how each of them does. */
export function createParticipantsPanel(engine: ConsoleEngine, tools: ParticipantsTools): Panel {
  const invite = button("field-button", "Invite…", () => tools.invite());
  const audit = button("field-button quiet", "Audit trail…", () => tools.audit());
  const recordings = button("field-button quiet", "Recordings", () => tools.recordings());
  const episodes = button("field-button quiet", "Episodes", () => tools.episodes());
  const robotLink = button("field-button quiet", "Robot link…", () => tools.robotLink()?.());
  const toolRow = h("div", "people-tools", {}, invite, recordings, episodes, audit, robotLink);
  const empty = h("p", "muted", {}, "Nobody is connected");
  const leading = h("ul", "people");
  const rename = createRenameForm(engine);
  const crowd = h("span", "crowd-words");
  const toggle = button("quiet-button", "Show all", () => (showsAll = !showsAll));
  const crowdHead = h("div", "crowd", {}, crowd, toggle);
  const watching = h("ul", "people");
  const rows = new Map<string, ParticipantRow>();
  let showsAll = false;
  let shown: readonly unknown[] = []; // what the lists were last made from
  const element = h("section", "people-panel", { "aria-label": "People" });
  element.append(toolRow, empty, leading, rename, crowdHead, watching);
  for (const part of [toolRow, rename, crowdHead]) setHidden(part, true); // until it is known who may

  return {
    element,
    update() {
      const { participants, seat, welcome } = engine.state;
      const mayPair = tools.robotLink() !== null;
      const made = [participants, seat, welcome, showsAll, mayPair];
      if (made.every((each, at) => each === shown[at])) return;
      shown = made;
      const people = sortParticipants(participants, seat, welcome?.peer ?? null);
      const crowded = people.watching.length > FEW;
      setHidden(toolRow, welcome === null && !mayPair);
      setHidden(recordings, welcome === null);
      setHidden(episodes, welcome === null);
      setHidden(robotLink, !mayPair);
      setHidden(invite, !mayDrive(engine.state));
      setHidden(audit, welcome?.role !== "supervisor");
      setHidden(empty, participants.length > 0);
      setHidden(rename, welcome === null);
      setHidden(crowdHead, people.watching.length === 0);
      setText(crowd, crowdLabel(summarise(people.watching)));
      setHidden(toggle, !crowded);
      setText(toggle, showsAll ? "Show few" : "Show all");
      forget(new Set(participants.map((person) => person.peer)));
      place(leading, people.leading);
      place(watching, showsAll ? people.watching : people.watching.slice(0, FEW));
    },
  };

  function place(list: HTMLElement, people: readonly Participant[]): void {
    const { seat, welcome } = engine.state;
    const claims = new Set(seat?.claims.map((claim) => claim.peer));
    const elements = people.map((person) => {
      const row =
        rows.get(person.peer) ?? createParticipantRow((peer, silent) => engine.session.silence(peer, silent));
      rows.set(person.peer, row);
      const drives = person.peer === seat?.holder;
      const isMe = person.peer === welcome?.peer;
      const maySilence = welcome?.role === "supervisor" && !isMe;
      row.show(person, { isMe, drives, asks: claims.has(person.peer), maySilence });
      return row.element;
    });
    const isSame =
      elements.length === list.children.length && elements.every((each, at) => each === list.children[at]);
    if (!isSame) list.replaceChildren(...elements);
  }

  function forget(present: ReadonlySet<string>): void {
    for (const peer of rows.keys()) if (!present.has(peer)) rows.delete(peer);
  }
}
