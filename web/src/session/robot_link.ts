import { isRecord } from "../protocol/schema_check";

/** What became of the pairing code. */
export type CodeState = "none" | "waiting" | "paired" | "expired" | "too_many_tries";

/** A robot that called the console and was not let in. */
export interface WaitingRobot {
  readonly address: string;
  readonly since: number; // s since 1970
  readonly name: string; // as it calls itself, unproven; "" if it has not said
  readonly why: string; // the name of the refusal, or "taken"
}

/** How the console and its robot find each other. */
export interface RobotLink {
  readonly dialsIn: boolean; // false: the console connects to the robot, and nothing is paired
  readonly state: "unpaired" | "away" | "connected";
  readonly key: "" | "paired" | "settings"; // where the robot's key is from
  readonly robot: string; // "planar", as the robot calls itself
  readonly by: string; // who paired it
  readonly at: number; // s since 1970; 0 if it was not paired
  readonly address: string; // where it is connected from; "" while it is away
  readonly detail: string; // why it is not connected
  readonly mayPair: boolean;
  readonly code: CodeState;
  readonly seconds: number; // for which the code is good
  readonly tries: number; // that are left
  readonly refused: string; // why the newest robot was refused; "" if none was
  readonly waits: readonly WaitingRobot[]; // oldest first; empty for all but supervisors
}

export interface PairingCode {
  readonly code: string; // "K7-3F9QW-2MXBD"
  readonly command: string; // for the robot's computer
}

const REFUSED: Readonly<Record<string, string>> = {
  wrong_code: "A robot was refused: its code was not this one.",
  wrong_certificate:
    "A robot was refused: it saw another certificate than this console's. Somebody may be between the two, or a proxy whose CA the robot does not know.",
};

const OLD_CODE = "its code is no longer good";
const REASONS: Readonly<Record<string, string>> = {
  robot_unknown: "it has no key of this console",
  not_pairing: "no code with which it could pair is open",
  code_expired: OLD_CODE,
  code_used: OLD_CODE,
  too_many_tries: OLD_CODE,
  wrong_code: "its code was not the right one",
  wrong_certificate: "it saw another certificate than this console's",
};

/** The answer of GET /api/dial-in; null when it is none. */
export function parseRobotLink(answer: unknown): RobotLink | null {
  if (!isRecord(answer) || typeof answer["dials_in"] !== "boolean") return null;
  const { state, key } = answer;
  if (state !== "unpaired" && state !== "away" && state !== "connected") return null;
  const pairing = isRecord(answer["pairing"]) ? answer["pairing"] : {};
  return {
    dialsIn: answer["dials_in"],
    state,
    key: key === "paired" || key === "settings" ? key : "",
    robot: text(answer["robot"]),
    by: text(answer["by"]),
    at: number(answer["at"]),
    address: text(answer["address"]),
    detail: text(answer["detail"]),
    mayPair: answer["may_pair"] === true,
    code: codeState(pairing["state"]),
    seconds: number(pairing["seconds"]),
    tries: number(pairing["tries"]),
    refused: text(pairing["refused"]),
    waits: Array.isArray(answer["waits"]) ? answer["waits"].flatMap(waitingRobots) : [],
  };
}

/** The answer of POST /api/dial-in/code; null when it is none. */
export function parsePairingCode(answer: unknown): PairingCode | null {
  if (!isRecord(answer)) return null;
  const { code, command } = answer;
  return typeof code === "string" && typeof command === "string" ? { code, command } : null;
}

/** The first line: which robot, and whether it is there. */
export function robotLinkTitle(link: RobotLink): string {
  const name = link.robot === "" ? "The robot" : link.robot;
  if (link.state === "connected") return `${name} is connected`;
  if (link.state === "away") return `${name} is away`;
  return "No robot is paired";
}

/** The second line: who paired it, from where it comes, or what to do. `time`: the day and time of pairing. */
export function robotLinkAbout(link: RobotLink, time: string): string {
  if (link.state === "unpaired")
    return "A robot that is not paired cannot be driven. A code lets one robot in, once.";
  const parts = [];
  if (link.key === "settings") parts.push("Its key is in the console's settings");
  if (link.key === "paired") parts.push(link.by === "" ? `Paired ${time}` : `Paired by ${link.by}, ${time}`);
  if (link.address !== "") parts.push(`from ${link.address}`);
  if (link.state === "away") parts.push("it dials in by itself when it runs and has a network");
  return `${parts.join(" · ")}.`;
}

/** What is to be known of the code; "" while there is none. */
export function codeLabel(link: RobotLink): string {
  if (link.code === "waiting") {
    const seconds = Math.ceil(link.seconds);
    const clock = `${Math.floor(seconds / 60)}:${`${seconds % 60}`.padStart(2, "0")}`;
    return `Waits for the robot · good for ${clock} · ${link.tries} ${link.tries === 1 ? "try" : "tries"} left`;
  }
  if (link.code === "expired") return "The code has expired. Make a new one.";
  if (link.code === "too_many_tries") return "The code was typed wrongly too often. Make a new one.";
  if (link.code === "paired" && link.state === "away") return "Paired. The robot connects now.";
  return "";
}

/** A warning if the command names the machine that it is typed on, where only a robot beside the console can use it. */
export function loopbackWarning(command: string): string {
  const host = /--console \w+:\/\/(\[[^\]]*\]|[^\s/:]+)/.exec(command)?.[1] ?? "";
  if (!/^(localhost|127(\.\d+){3}|\[::1\])$/.test(host)) return "";
  return `${host} in this command is the robot's own computer, so it works only beside the console. For a robot elsewhere, start the console with --public-url, the address by which robots reach it, and with --host if it listens on loopback alone.`;
}

/** Why a robot was just refused; "" while none was. */
export function refusedLabel(link: RobotLink): string {
  return link.code === "waiting" ? (REFUSED[link.refused] ?? "") : "";
}

/** That a robot waits, why, and what lets it in. */
export function waitLabel(robot: WaitingRobot, link: RobotLink): string {
  const who = robot.name === "" ? "A robot" : `A robot that calls itself “${robot.name}”`;
  if (robot.why === "taken")
    return `Another robot with this robot's key waits at ${robot.address}: a second robot, or a copy of its state directory, may be running.`;
  return `${who} waits at ${robot.address}: ${REASONS[robot.why] ?? "it was not let in"}. ${remedy(robot.why, link)}`;
}

function remedy(why: string, link: RobotLink): string {
  if (link.key === "settings") return "Only the robot with the key in the console's settings comes in.";
  if (link.key === "paired")
    return `${link.robot === "" ? "Another robot" : link.robot} is paired here: to pair this one instead, forget that one first.`;
  if (why === "wrong_certificate") return "Somebody may be between the two, or a proxy.";
  return link.code === "waiting" ? "Start it with the code that is open." : "Make a code and pair it.";
}

function waitingRobots(value: unknown): WaitingRobot[] {
  if (!isRecord(value) || typeof value["address"] !== "string") return [];
  const { address, since, name, why } = value;
  return [{ address, since: number(since), name: text(name), why: text(why) }];
}

function codeState(value: unknown): CodeState {
  const known =
    value === "waiting" || value === "paired" || value === "expired" || value === "too_many_tries";
  return known ? value : "none";
}

function text(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function number(value: unknown): number {
  return typeof value === "number" && Number.isFinite(value) ? value : 0;
}
