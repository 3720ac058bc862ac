import type { PollState } from "../episode_poll";
import { requestErrorLabel } from "../../transport/signalling/session_api";
import { grouped } from "../../ui/elements/dom";

/** Why the list is empty; "" if it is not. `shown`: episodes that pass the filter; `all`: that there are. */
export function emptyWords({ recordings, pending, trouble }: PollState, shown: number, all: number): string {
  if (recordings === null) return trouble === null ? "Loading the episodes …" : "";
  if (shown > 0) return "";
  if (all > 0) return "No episode is like this.";
  if (pending > 0) return "Loading the episodes …";
  return "There are no episodes yet. Record on the console’s page, then begin one in the bar under the control seat.";
}

/** Why the list is not the newest, and how old it is; "" if it is. */
export function troubleWords({ recordings, trouble, asOf }: PollState, now: number): string {
  if (trouble === null) return "";
  const words = requestErrorLabel(trouble);
  if (recordings === null) return words;
  const seconds = Math.round((now - asOf) / 1000);
  return `${words} What is shown is ${seconds < 90 ? `${seconds} s` : `${Math.round(seconds / 60)} min`} old.`;
}

/** What is missing in the list; "" if nothing is. */
export function readingWords({ pending, unreadable }: PollState): string {
  const words = [];
  if (pending > 0) words.push(`Reading ${grouped(pending)} more recordings …`);
  if (unreadable > 0)
    words.push(unreadable === 1 ? "1 file cannot be read." : `${grouped(unreadable)} files cannot be read.`);
  return words.join(" ");
}
