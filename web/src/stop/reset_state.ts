import type { ConsoleState } from "../session/console_state";
import { holdsSeat } from "../session/console_state";
import type { Refusal, StopState } from "../protocol/wire";
import { resetRefusalLabel } from "./reset_labels";

/** A stop is looked at this long before the button takes a hand; the bridge refuses an earlier reset. */
const LOOK_MS = 1000;
const NEWS_MS = 10_000;

/** The reset of the stop that the page shows. A hand that was on the button before that stop came resets nothing. */
export interface ResetState {
  number: number | null; // of the stop on screen; null: none is
  shownMs: number; // since when
  news: string; // what became of the last try; ""
  newsMs: number;
}

export function createResetState(): ResetState {
  return { number: null, shownMs: Infinity, news: "", newsMs: -Infinity };
}

/** Call with every drawing: `stop` is what is on screen, null when another thing is. */
export function noteShownStop(offer: ResetState, stop: StopState | null, now: number): void {
  const number = stop === null ? null : stop.number;
  if (number === offer.number) return;
  offer.number = number;
  offer.shownMs = now;
  if (number === null) offer.news = "";
}

/** Whole seconds until the button takes a hand; 0: it does. */
export function secondsToReset(offer: ResetState, now: number): number {
  return offer.number === null ? 1 : Math.max(0, Math.ceil((offer.shownMs + LOOK_MS - now) / 1000));
}

/** The number that a button held since `heldMs` resets; null: it must not. */
export function resetNumber(offer: ResetState, heldMs: number): number | null {
  return offer.number !== null && heldMs >= offer.shownMs + LOOK_MS ? offer.number : null;
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

export function tookResetRefusal(offer: ResetState, refusal: Refusal, now: number): void {
  offer.news = resetRefusalLabel(refusal);
  offer.newsMs = now;
}

export function resetNotSent(offer: ResetState, now: number): void {
  offer.news = "Not reset: the console cannot hear this page. Wait for the connection, then hold again.";
  offer.newsMs = now;
}

export function resetNews(offer: ResetState, now: number): string {
  return now - offer.newsMs < NEWS_MS ? offer.news : "";
}
