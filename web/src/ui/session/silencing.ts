import type { Participant } from "../../protocol/wire";
import { button, h, setHidden, setText } from "../elements/dom";

/** What a supervisor does about somebody whose page keeps pressing STOP. */
export interface Silencing {
  readonly element: HTMLElement;
  show(person: Participant, isAllowed: boolean): void;
}

/** Silencing takes a second press, beside words that say what it means; to let STOP work again takes one. */
export function createSilencing(silence: (peer: string, silent: boolean) => void): Silencing {
  let peer = "";
  let asks = false;
  const ask = button("quiet-button", "Silence STOP…", () => turn(true));
  const undo = button("quiet-button", "Let STOP work again", () => silence(peer, false));
  const question = h("p", "silence-question");
  const confirm = button("field-button danger", "Silence", () => {
    turn(false);
    silence(peer, true);
  });
  const keep = button("field-button quiet", "Do not", () => turn(false));
  const plate = h("div", "silence-plate", {}, question, h("div", "silence-buttons", {}, confirm, keep));
  const element = h("div", "person-silence", {}, ask, undo, plate);
  let isSilenced = false;
  const turn = (asking: boolean): void => {
    asks = asking;
    draw();
    if (asking) keep.focus();
  };
  const draw = (): void => {
    setHidden(ask, asks || isSilenced);
    setHidden(undo, !isSilenced);
    setHidden(plate, !asks || isSilenced);
  };
  return {
    element,
    show(person, isAllowed) {
      peer = person.peer;
      isSilenced = person.silenced;
      if (isSilenced) asks = false;
      setHidden(element, !isAllowed);
      setText(
        question,
        `STOP from ${person.name}’s link, and from links that were made with it, will have no effect for ten minutes. A stop that holds now stays until it is reset.`,
      );
      draw();
    },
  };
}
