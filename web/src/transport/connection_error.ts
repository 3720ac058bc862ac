/** Why there is no connection; it is tried again by itself. */
export type ConnectionErrorKind =
  | "console_full"
  | "console_unreachable"
  | "lost"
  | "no_path"
  | "no_turn_path"
  | "origin_refused"
  | "refused"
  | "relay_lost"
  | "robot_unreachable"
  | "shutting_down"
  | "silent"
  | "token_refused";

/** Why this link will never connect again. */
export type ConnectionEnd = "link_expired" | "link_revoked";

export interface ConnectionErrorLabels {
  readonly title: string;
  readonly text: string; // what it means, and what to do
}

/** Names of the console's errors (docs/console-api.md) that a person can do something about. */
const BY_ERROR: ReadonlyMap<string, ConnectionErrorKind> = new Map([
  ["robot_unreachable", "robot_unreachable"],
  ["too_many_peers", "console_full"],
  ["shutting_down", "shutting_down"],
  ["origin_refused", "origin_refused"],
  ["host_refused", "origin_refused"],
]);

/** What an HTTP error means for the connection. `status` 0: there was no answer. */
export function connectionErrorOf(status: number, error: string): ConnectionErrorKind {
  const named = BY_ERROR.get(error);
  if (named !== undefined) return named;
  if (status === 0 || status === 502 || status === 504) return "console_unreachable"; // or a proxy says so
  return status === 401 || status === 403 ? "token_refused" : "refused";
}

export const CONNECTION_ERROR_LABELS: Readonly<Record<ConnectionErrorKind, ConnectionErrorLabels>> = {
  console_full: {
    title: "The console is full",
    text: "The console serves as many people as it may. Somebody has to leave first.",
  },
  console_unreachable: {
    title: "Console unreachable",
    text: "The console does not answer: it is not running, or this device is offline. Check your network, then ask the person who runs the console.",
  },
  lost: { title: "Connection lost", text: "The robot comes to rest." },
  no_path: {
    title: "No path for pictures and commands",
    text: "The console answers, but its UDP packets do not get through. A firewall blocks UDP, or the console needs a TURN server. Try another network, or show this to the person who runs the console.",
  },
  no_turn_path: {
    title: "No path through the TURN server",
    text: "This link allows only a way through a TURN server, and none could be used: the console names none, or this device cannot reach it. Remove relay=only from the link to try a direct path.",
  },
  origin_refused: {
    title: "Opened at a wrong address",
    text: "The console does not serve pages at this address. Open the link exactly as it was given to you.",
  },
  refused: { title: "The console refused the connection", text: "" },
  relay_lost: {
    title: "The relay was lost",
    text: "No other relay is left: this page connects to the console itself in a moment.",
  },
  robot_unreachable: {
    title: "Robot unreachable",
    text: "The console runs, but it has no link to the robot yet. Check that the robot is switched on and its bridge runs.",
  },
  shutting_down: {
    title: "The console is stopping",
    text: "This page reconnects when the console has started again.",
  },
  silent: {
    title: "Connection lost",
    text: "The console fell silent and no other path was found. The robot comes to rest.",
  },
  token_refused: {
    title: "This link is not valid",
    text: "The console does not know this link: the link is incomplete, or the console has a new key. Open the newest link, or ask for one.",
  },
};

export const CONNECTION_END_LABELS: Readonly<Record<ConnectionEnd, ConnectionErrorLabels>> = {
  link_revoked: {
    title: "This link was revoked",
    text: "The link ended, so this page is closed. Ask the person who invited you for a new link.",
  },
  link_expired: {
    title: "This link has expired",
    text: "The link was valid for a limited time, so this page is closed. Ask for a new link to come back.",
  },
};
