import { h } from "./dom";

const HOLD_MS = 1000;

/** A button that acts only after it was held for a second; letting go earlier does nothing. */
export function holdButton(className: string, label: string, onheld: () => void): HTMLButtonElement {
  const element = h(
    "button",
    `hold-button ${className}`,
    { type: "button" },
    h("span", "hold-fill"),
    h("span", "hold-label", {}, label),
  );
  let timer: ReturnType<typeof setTimeout> | undefined;
  const start = (): void => {
    if (timer !== undefined) return;
    element.classList.add("is-holding");
    timer = setTimeout(() => {
      end();
      onheld();
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
  return element;
}
