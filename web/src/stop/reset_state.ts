import type { ConsoleState } from "../session/console_state";
import { holdsSeat } from "../session/console_state";
import type { Refusal, StopState } from "../protocol/wire";
import { resetRefusalLabel } from "./reset_labels";

/** A stop is looked at this long before the button takes a hand; the bridge refuses an earlier reset. */
const LOOK_MS = 1000;
const MESSAGE_MS = 10_000;

/** The reset of the stop that the page shows. A hand that was on the button before that stop came resets nothing. */
export interface ResetState {
  number: number | null; // of the stop on screen; null: none is
  shownMs: number; // since when
  message: string; // what became of the last try; ""
  messageMs: number;
}

export function createResetState(): ResetState {
  return { number: null, shownMs: Infinity, message: "", messageMs: -Infinity };
}

/** Call with every drawing: `stop` is what is on screen, null when another thing is. */
export function noteShownStop(state: ResetState, stop: StopState | null, now: number): void {
  const number = stop === null ? null : stop.number;
  if (number === state.number) return;
  state.number = number;
  state.shownMs = now;
  if (number === null) state.message = "";
}

/** Whole seconds until the button takes a hand; 0: it does. */
export function secondsToReset(state: ResetState, now: number): number {
  return state.number === null ? 1 : Math.max(0, Math.ceil((state.shownMs + LOOK_MS - now) / 1000));
}

/** The number that a button held since `heldMs` resets; null: it must not. */
export function resetNumber(state: ResetState, heldMs: number): number | null {
  return state.number !== null && heldMs >= state.shownMs + LOOK_MS ? state.number : null;
}

/** Whether this page's person may reset. */
export function mayReset(state: ConsoleState): boolean {
  return holdsSeat(state) || state.welcome?.role === "supervisor";
}

/** Who may, for one who may not. */
export function whoResets(state: ConsoleState): string {
  const driver = state.seat?.name ?? "";
  if (driver !== "") return `${driver}, who has control, or a supervisor can reset it.`;
  return state.welcome?.role === "operator"
    ? "Request control, then you can reset it. A supervisor can too."
    : "An operator who takes control, or a supervisor, can reset it.";
}

export function tookResetRefusal(state: ResetState, refusal: Refusal, now: number): void {
  state.message = resetRefusalLabel(refusal);
  state.messageMs = now;
}

export function resetNotSent(state: ResetState, now: number): void {
  state.message = "Not reset: the console cannot hear this page. Wait for the connection, then hold again.";
  state.messageMs = now;
}

export function resetMessage(state: ResetState, now: number): string {
  return now - state.messageMs < MESSAGE_MS ? state.message : "";
}
