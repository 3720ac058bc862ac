import type { Refusal } from "../../protocol/wire";

/** Something to tell about the seat. */
export interface SeatNotice {
  readonly words: string;
}

/** What became of a request for the seat; null when the refusal is about something else. */
export function requestAnswer(refusal: Refusal, holder: string): string | null {
  const who = holder === "" ? "The driver" : holder;
  if (refusal.reason === "seat_taken") return refusal.detail === "" ? null : `Not asked: ${refusal.detail}`;
  if (refusal.reason !== "declined") return null;
  if (refusal.detail === "no answer") return `${who} did not answer: your request is declined`;
  return refusal.detail === "declined"
    ? `${who} declined your request`
    : `Declined just now: ${refusal.detail}`;
}
