import type { Seat, Welcome } from "../../protocol/wire";

export type Role = Welcome["role"];

/** How this page stands to the control seat. `asked`: somebody else holds it and was asked for it. */
export type SeatStatus = "unknown" | "free" | "mine" | "asked" | "held";

/** Somebody who asked the holder for the seat. */
export interface Claim {
  readonly peer: string;
  readonly name: string;
  readonly secondsLeft: number; // then it counts as declined
}

/** What the one button beside the seat does. `why` says why it cannot be pressed; null when it can. */
export interface SeatAction {
  readonly kind: "request" | "take" | "withdraw" | "release";
  readonly label: string;
  readonly why: string | null;
}

export function seatStatus(seat: Seat | null, me: string | null): SeatStatus {
  if (seat === null || me === null) return "unknown";
  if (seat.holder === "") return "free";
  if (seat.holder === me) return "mine";
  return seat.claims.some((claim) => claim.peer === me) ? "asked" : "held";
}

/** The claims `agedMs` after the console said them, who waits longest first. */
export function claimsAfter(seat: Seat | null, agedMs: number): Claim[] {
  return (seat?.claims ?? [])
    .map(({ peer, name, seconds_left }) => ({ peer, name, secondsLeft: left(seconds_left, agedMs) }))
    .sort((one, other) => one.secondsLeft - other.secondsLeft);
}

/** Until an idle holder loses the seat; null while nobody is about to. */
export function idleSecondsAfter(seat: Seat | null, agedMs: number): number | null {
  if (seat === null || seat.holder === "" || seat.idle_seconds_left === null) return null;
  return left(seat.idle_seconds_left, agedMs);
}

/**
 * The button beside the seat for this role; null for who may only watch. It never goes away for who may drive.
 * `policy`: one drives, and every person who may drive takes the robot from it at once.
 */
export function seatAction(role: Role | null, status: SeatStatus, policy = false): SeatAction | null {
  if (role !== "operator" && role !== "supervisor") return null;
  if (status === "mine") return { kind: "release", label: "Give control back", why: null };
  const why = status === "unknown" ? "Not connected" : null;
  if (policy) return { kind: "take", label: "Take over", why };
  if (role === "supervisor") return { kind: "take", label: "Take control", why };
  if (status === "asked") return { kind: "withdraw", label: "Withdraw request", why };
  return { kind: "request", label: "Request control", why };
}

/** A finger that was on its way to "Request control" must not give back the seat that came in the meantime. */
const READ_MS = 400;

/** Whether somebody who presses the button can mean what it says, which it has said for `shownMs`. */
export function isMeant(kind: SeatAction["kind"], shownMs: number): boolean {
  return kind !== "release" || shownMs >= READ_MS;
}

function left(seconds: number, agedMs: number): number {
  return Math.max(0, Math.ceil(seconds - agedMs / 1000));
}
