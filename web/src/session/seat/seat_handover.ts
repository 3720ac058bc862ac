import type { Seat } from "../../protocol/wire";

/** One change of who drives, in words for everybody's screen. */
export interface SeatHandover {
  readonly words: string;
  readonly toMe: boolean; // this page drives from now on
  readonly fromMe: boolean; // it did until now
}

/** What a seat message changes; null when the same person goes on, and for the first message of a connection. */
export function seatHandover(before: Seat | null, after: Seat, me: string | null): SeatHandover | null {
  if (before === null || before.holder === after.holder) return null;
  const toMe = after.holder !== "" && after.holder === me;
  const fromMe = before.holder !== "" && before.holder === me;
  const taker = toMe ? "you" : nameOf(after.name);
  const giver = fromMe ? "you" : nameOf(before.name);
  const words =
    before.holder === "" ? `${taker} took the free control seat` : changeWords(giver, taker, fromMe, after);
  return { words: words.charAt(0).toUpperCase() + words.slice(1), toMe, fromMe };
}

function changeWords(giver: string, taker: string, fromMe: boolean, after: Seat): string {
  if (after.why === "offered") return `${giver} offered the control seat to policies`;
  if (after.why === "granted") return `${giver} handed control to ${taker}`;
  if (after.why === "taken") return `${taker} took control from ${giver}`;
  const has = taker === "you" ? "you have" : `${taker} has`;
  if (after.why === "released")
    return `${giver} gave control back: ${after.holder === "" ? "the control seat is free" : `${has} it`}`;
  const now = after.holder === "" ? "the control seat is free" : `${has} control`;
  return `${giver} ${leaveWords(after.why, fromMe)}: ${now}`;
}

function leaveWords(why: string, wasMe: boolean): string {
  if (why === "disconnected") return "left";
  if (why === "heartbeat lost") return "fell silent";
  if (why === "idle") return wasMe ? "were idle" : "was idle";
  const words = wasMe ? "no longer drive" : "no longer drives";
  return why === "" ? words : `${words} (${why})`;
}

function nameOf(name: string): string {
  return name === "" ? "somebody" : name;
}
