import type { Disposal } from "./disposal";

/** What Enter and the space bar work when it has the focus. */
export const CONTROLS = "button, a, summary, [role=button]";
/** Fields that a pointer sets at once, so that nobody goes on writing in them. */
const SET_BY_POINTER = "input[type=range], input[type=checkbox], input[type=radio]";

/**
 * Who clicks with a pointer keeps the keyboard for the robot: a button that was clicked would take Enter and the space
 * bar from then on. The focus of somebody who moves it with Tab stays where it is.
 */
export function keepKeyboardFree(disposal: Disposal): void {
  disposal.listen(window, "pointerup", () => letGo(`${CONTROLS}, ${SET_BY_POINTER}`));
  // After the listeners of what was clicked: a dialogue that closes gives the focus back to its button.
  disposal.listen(window, "click", (event) => {
    if (event.detail > 0) letGo(`${CONTROLS}, ${SET_BY_POINTER}`);
  });
}

/** The control that Enter and the space bar work now, as it is called; null: they are the robot's. */
export function focusedControl(): string | null {
  const active = document.activeElement;
  if (active === null || !active.matches(CONTROLS)) return null;
  const name = (active.getAttribute("aria-label") ?? wordsOf(active)).trim();
  return name.length > 24 ? `${name.slice(0, 23)}…` : name;
}

/** Its text without the key that works it too, and without what is for the eye alone. */
function wordsOf(control: Element): string {
  const copy = control.cloneNode(true) as Element;
  for (const each of copy.querySelectorAll("kbd, [aria-hidden=true]")) each.remove();
  return copy.textContent;
}

function letGo(selector: string): void {
  const active = document.activeElement;
  if (active instanceof HTMLElement && active.matches(selector)) active.blur();
}
