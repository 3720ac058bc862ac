import { personWords } from "../core/people";
import type { Participant } from "../wire";
import { h, setHidden, setText } from "./dom";

/** What somebody is besides their role. */
export interface Marks {
  readonly isMe: boolean;
  readonly drives: boolean;
  readonly asks: boolean;
}

/** One person's line; it stays while the person does, so that a list of hundreds is not built anew every second. */
export interface PersonRow {
  readonly element: HTMLElement;
  show(person: Participant, marks: Marks): void;
}

export function createPersonRow(): PersonRow {
  const name = h("span", "person-name");
  const you = h("span", "person-tag", {}, "you");
  const drives = h("span", "person-tag drives", {}, "drives");
  const asks = h("span", "person-tag asks", {}, "asks for control");
  const role = h("span", "person-role");
  const figures = h("span", "person-figures");
  const line = h("span", "person-line", {}, name, you, drives, asks);
  return {
    element: h("li", "person", {}, line, role, figures),
    show(person, marks) {
      setText(name, person.name);
      setHidden(you, !marks.isMe);
      setHidden(drives, !marks.drives);
      setHidden(asks, !marks.asks);
      setText(role, person.role);
      setText(figures, personWords(person));
    },
  };
}
