import { setData } from "./dom";

/** Marks the page for styles that are for fingers, from the first touch on. */
export function watchTouch(): void {
  const html = document.documentElement;
  if (matchMedia("(pointer: coarse)").matches) setData(html, "touch", "true");
  addEventListener("touchstart", () => setData(html, "touch", "true"), { once: true, passive: true });
}
