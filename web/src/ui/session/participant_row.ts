import { participantLabel } from "../../session/participants";
import type { Participant } from "../../protocol/wire";
import { h, setHidden, setText } from "../elements/dom";
import { createSilencing } from "./silencing";

/** What somebody is besides their role. */
export interface Marks {
  readonly isMe: boolean;
  readonly drives: boolean;
  readonly asks: boolean;
  readonly maySilence: boolean; // whether this page's person may silence the stops of that one
}

/** One person's line; it stays while the person does, so that a list of hundreds is not built anew every second. */
export interface ParticipantRow {
  readonly element: HTMLElement;
  show(person: Participant, marks: Marks): void;
}

/** `silence` carries out what a supervisor decided about this person's STOP. */
export function createParticipantRow(silence: (peer: string, silent: boolean) => void): ParticipantRow {
  const name = h("span", "person-name");
  const you = h("span", "person-tag", {}, "you");
  const drives = h("span", "person-tag drives", {}, "drives");
  const asks = h("span", "person-tag asks", {}, "asks for control");
  const role = h("span", "person-role");
  const figures = h("span", "person-figures");
  const silenced = h("span", "person-tag silenced", {}, "STOP silenced");
  const line = h("span", "person-line", {}, name, you, drives, asks, silenced);
  const silencing = createSilencing(silence);
  return {
    element: h("li", "person", {}, line, role, figures, silencing.element),
    show(person, marks) {
      setHidden(silenced, !person.silenced);
      silencing.show(person, marks.maySilence);
      setText(name, person.name);
      setHidden(you, !marks.isMe);
      setHidden(drives, !marks.drives);
      setHidden(asks, !marks.asks);
      setText(role, person.role);
      setText(figures, participantLabel(person));
    },
  };
}
