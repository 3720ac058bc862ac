import { pageAction, type PageAction } from "../input/shortcuts";
import type { ConsoleEngine } from "../engine/console_engine";
import { FIELDS } from "../input/keyboard";

/** Carries out what keys do to the page. They reach it whether or not it is armed, but for keys that drive. */
export function watchPageKeys(engine: ConsoleEngine, act: (action: PageAction) => void): void {
  addEventListener("keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof Element && event.target.matches(FIELDS)) return;
    const action = pageAction(event.code, engine.driving.isArmed(), engine.state.robot?.description ?? null);
    if (action !== null) act(action);
  });
}
