import { isRecord } from "../protocol/schema_check";
import type { Role } from "./seat/seat_status";

/** A link that somebody was given. */
export interface Invitation {
  readonly id: string;
  readonly name: string;
  readonly role: Role;
  readonly by: string; // who invited; "" for the links made at start
  readonly expires: number; // s since 1970
  readonly revoked: boolean;
  readonly connected: number; // pages open with it now
}

export interface NewInvitation {
  readonly invitation: Invitation;
  readonly link: string;
}

/** How long a link may be good for: what is offered. */
export const EXPIRIES: readonly { readonly label: string; readonly seconds: number }[] = [
  { label: "1 hour", seconds: 3600 },
  { label: "8 hours", seconds: 8 * 3600 },
  { label: "1 day", seconds: 24 * 3600 },
  { label: "1 week", seconds: 7 * 24 * 3600 },
];

/** Whom this role may invite. */
export function invitableRoles(role: Role | null): readonly Role[] {
  if (role === "supervisor") return ["observer", "policy", "operator", "supervisor"];
  return role === "operator" ? ["observer", "policy", "operator"] : [];
}

export function parseInvitations(answer: unknown): Invitation[] {
  const found = isRecord(answer) ? answer["invitations"] : undefined;
  if (!Array.isArray(found)) return [];
  return found.map(parseInvitation).filter((each) => each !== null);
}

/** The answer to a new invitation; null when it is none. */
export function parseNewInvitation(answer: unknown): NewInvitation | null {
  const invitation = parseInvitation(answer);
  const link = isRecord(answer) ? answer["link"] : undefined;
  return invitation !== null && typeof link === "string" ? { invitation, link } : null;
}

/** Still good ones first, the last made on top. */
export function sortInvitations(invitations: readonly Invitation[], wallSeconds: number): Invitation[] {
  const good = (each: Invitation): number => Number(isGood(each, wallSeconds));
  return [...invitations].sort((one, other) => good(other) - good(one) || other.expires - one.expires);
}

export function isGood(invitation: Invitation, wallSeconds: number): boolean {
  return !invitation.revoked && invitation.expires > wallSeconds;
}

/** "in 7 h 58 min": how long it is still good. */
export function expiryLabel(invitation: Invitation, wallSeconds: number): string {
  if (invitation.revoked) return "revoked";
  const seconds = invitation.expires - wallSeconds;
  if (seconds <= 0) return "expired";
  const minutes = Math.ceil(seconds / 60);
  if (minutes < 60) return `${minutes} min left`;
  const hours = Math.floor(minutes / 60);
  return hours < 48 ? `${hours} h ${minutes % 60} min left` : `${Math.floor(hours / 24)} days left`;
}

function parseInvitation(value: unknown): Invitation | null {
  if (!isRecord(value)) return null;
  const { id, name, role, by, expires, revoked, connected } = value;
  if (typeof id !== "string" || typeof expires !== "number") return null;
  if (role !== "observer" && role !== "operator" && role !== "supervisor" && role !== "policy") return null;
  return {
    id,
    role,
    expires,
    name: typeof name === "string" ? name : "",
    by: typeof by === "string" ? by : "",
    revoked: revoked === true,
    connected: typeof connected === "number" ? connected : 0,
  };
}
