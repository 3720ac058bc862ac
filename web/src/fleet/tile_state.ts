import type { FleetRobot } from "./fleet_status";
import { clockLabel } from "./poll_state";
import { ageLabel, STALE_MS } from "../drive/feedback_age";
import { eventsBehind } from "../gate/gap_label";

/** The states of a robot in the overview, gravest first: this is the order of "trouble first". */
export const TILE_KINDS = [
  "trouble",
  "unreachable",
  "unknown",
  "stopped",
  "silent",
  "behind",
  "driven",
  "free",
] as const;
export type TileKind = (typeof TILE_KINDS)[number];

export type TileTone = "bad" | "wait" | "good" | "off";

export interface TileState {
  readonly kind: TileKind;
  readonly tone: TileTone;
  readonly words: string; // "Driven by Ann"
  readonly more: string; // what else there is to know of it, "" as a rule
}

/** What the overview knows of how it knows. */
export interface TileContext {
  readonly unknownSince: number | null; // ms since 1970 of the last answer, while the console is lost
  readonly heardAt: number; // ms since 1970: when `robot` was told
}

export function tileState(robot: FleetRobot, context: TileContext): TileState {
  if (context.unknownSince !== null) {
    const before = tileState(robot, { ...context, unknownSince: null });
    const words = `Unknown since ${clockLabel(context.unknownSince)}`;
    return { kind: "unknown", tone: "off", words, more: `Before: ${before.words}` };
  }
  if (robot.trouble !== "") return { kind: "trouble", tone: "bad", words: robot.trouble, more: "" };
  if (robot.link !== "up") return linkState(robot, context.heardAt);
  if (robot.stopped) return { kind: "stopped", tone: "bad", words: stopWords(robot), more: robot.stopReason };
  const silent = robot.feedbackAgeMs ?? Infinity;
  if (silent > STALE_MS)
    return { kind: "silent", tone: "wait", words: silentWords(robot.feedbackAgeMs), more: "" };
  const more = robot.faults.join(", ");
  if (robot.driver === "") return { kind: "free", tone: "off", words: "Free", more };
  const words = `Driven by ${robot.driver}`;
  if (robot.gap !== null && robot.tolerance !== null && Math.abs(robot.gap) > robot.tolerance)
    return {
      kind: "behind",
      tone: "wait",
      words,
      more: `Its pictures are ${eventsBehind(Math.abs(robot.gap))}`,
    };
  return { kind: "driven", tone: "good", words, more };
}

export function isTrouble(kind: TileKind): boolean {
  return kind !== "driven" && kind !== "free";
}

/** A robot that was stopped before it was lost still is. */
function linkState(robot: FleetRobot, heardAt: number): TileState {
  const stopped = robot.stopped ? `${stopWords(robot)} when it was last heard` : "";
  const since = robot.linkAgeMs === null ? null : clockLabel(heardAt - robot.linkAgeMs);
  if (robot.link === "unknown") {
    const words = since === null ? "Unknown: its console is silent" : `Unknown since ${since}`;
    return {
      kind: "unknown",
      tone: "off",
      words,
      more: stopped || (since === null ? "" : "Its console is silent"),
    };
  }
  const words = since === null ? "Not reached yet" : `Unreachable since ${since}`;
  return { kind: "unreachable", tone: "bad", words, more: stopped || robot.detail };
}

function stopWords(robot: FleetRobot): string {
  return robot.stopBy === "" ? "Stopped" : `Stopped by ${robot.stopBy}`;
}

function silentWords(ageMs: number | null): string {
  return ageMs === null ? "Silent: no feedback yet" : `Silent for ${ageLabel(ageMs)}`;
}
