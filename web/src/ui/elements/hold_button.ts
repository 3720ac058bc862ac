import { h, setText } from "./dom";

const HOLD_MS = 1000;

/** A button that acts only after it was held for a second; letting go earlier does nothing. */
export interface HoldButton {
  readonly element: HTMLButtonElement;
  /** What it says, and whether it takes a hand. One that is on it when it stops doing so has to come anew. */
  show(label: string, isReady: boolean): void;
}

/** `onheld` is told since when it was held. */
export function holdButton(className: string, onheld: (heldMs: number) => void): HoldButton {
  const label = h("span", "hold-label");
  const element = h("button", `hold-button ${className}`, { type: "button" }, h("span", "hold-fill"), label);
  let timer: ReturnType<typeof setTimeout> | undefined;
  const start = (): void => {
    if (timer !== undefined || element.disabled) return;
    const heldMs = performance.now();
    element.classList.add("is-holding");
    timer = setTimeout(() => {
      end();
      onheld(heldMs);
    }, HOLD_MS);
  };
  const end = (): void => {
    clearTimeout(timer);
    timer = undefined;
    element.classList.remove("is-holding");
  };
  element.style.setProperty("--hold", `${HOLD_MS}ms`);
  element.addEventListener("pointerdown", start);
  for (const type of ["pointerup", "pointerleave", "pointercancel", "blur", "keyup"])
    element.addEventListener(type, end);
  element.addEventListener("keydown", (event) => {
    if ((event.code === "Enter" || event.code === "Space") && !event.repeat) start();
  });
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  return {
    element,
    show(words, isReady) {
      setText(label, words);
      if (element.disabled === !isReady) return;
      if (!isReady) end();
      element.disabled = !isReady;
    },
  };
}
