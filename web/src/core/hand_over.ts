import type { Seat } from "../wire";

/** One change of who drives, in words for everybody's screen. */
export interface HandOver {
  readonly words: string;
  readonly toMe: boolean; // this page drives from now on
  readonly fromMe: boolean; // it did until now
}

/** What a seat message changes; null when the same person goes on, and for the first message of a connection. */
export function handOver(before: Seat | null, after: Seat, me: string | null): HandOver | null {
  if (before === null || before.holder === after.holder) return null;
  const toMe = after.holder !== "" && after.holder === me;
  const fromMe = before.holder !== "" && before.holder === me;
  return { words: changeWords(before, after, toMe, fromMe), toMe, fromMe };
}

function changeWords(before: Seat, after: Seat, toMe: boolean, fromMe: boolean): string {
  const taker = toMe ? "You" : nameOf(after.name);
  const giver = before.holder === "" ? null : fromMe ? "You" : nameOf(before.name);
  if (after.holder === "") return freeWords(giver ?? "Somebody", fromMe, after.why);
  if (giver === null) return `${taker} took the free control seat`;
  if (after.why === "granted") return `${giver} handed control to ${toMe ? "you" : taker}`;
  if (after.why === "taken") return `${taker} took control from ${fromMe ? "you" : giver}`;
  return `${taker} took control after ${fromMe ? "you" : giver}`;
}

function freeWords(giver: string, wasMe: boolean, why: string): string {
  const free = "the control seat is free";
  switch (why) {
    case "released":
      return `${giver} gave control back: ${free}`;
    case "disconnected":
      return `${giver} left: ${free}`;
    case "heartbeat lost":
      return `${giver} fell silent: ${free}`;
    case "idle":
      return `${giver} ${wasMe ? "were" : "was"} idle: ${free}`;
    case "revoked":
      return `${wasMe ? "Your" : `${giver}'s`} link was revoked: ${free}`;
    default:
      return why === "" ? capital(free) : `${capital(free)} (${why})`;
  }
}

function nameOf(name: string): string {
  return name === "" ? "Somebody" : name;
}

function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
