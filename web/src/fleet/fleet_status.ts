import { isRecord } from "../protocol/schema_check";

/** `unknown`: the console that has the robot's link is silent. */
export type FleetLink = "up" | "down" | "unknown";

/** One robot as the console tells it (docs/fleet.md). Ages are those of the moment it was told. */
export interface FleetRobot {
  readonly name: string; // "arm-2"; unique
  readonly label: string; // "Planar robot"; "" before the robot was reached
  readonly url: string; // of its page: "robots/arm-2/", or whole where another console has it
  readonly link: FleetLink;
  readonly detail: string; // why the link is down
  readonly linkAgeMs: number | null; // how long the link has been so; null: ever since the console started
  readonly event: number; // 0 before the first
  readonly stopped: boolean;
  readonly stopBy: string;
  readonly stopReason: string;
  readonly driver: string; // "" when the control seat is free
  readonly mayDrive: boolean; // whether this link may
  readonly people: readonly string[]; // names, as many as the console tells
  readonly peopleCount: number; // all of them
  readonly feedbackAgeMs: number | null; // null before the first
  readonly gap: number | null; // events, as the driver's page last reported; null without a driver
  readonly tolerance: number | null; // the driver's, where it is known
  readonly recording: boolean;
  readonly eventRate: number; // events a second
  readonly faults: readonly string[];
  readonly console: string; // which one has its link; "" for the one that was asked
  readonly trouble: string; // what is wrong with its place in the fleet; "" as a rule
  readonly hasPicture: boolean;
}

export interface FleetNotice {
  readonly level: "warning" | "error";
  readonly text: string;
}

export interface FleetStatus {
  readonly role: string; // of this link; "" when not told
  readonly robots: readonly FleetRobot[];
  readonly notices: readonly FleetNotice[];
}

/** What became of a STOP at one robot. */
export interface StopReply {
  readonly name: string;
  readonly delivered: boolean;
  readonly kept: boolean; // on that robot's disk
  readonly detail: string;
}

/** null: it is none. What is missing or of a wrong kind counts as not known; a robot without a name is left out. */
export function parseFleet(value: unknown): FleetStatus | null {
  if (!isRecord(value) || !Array.isArray(value["robots"])) return null;
  const you = isRecord(value["you"]) ? value["you"] : {};
  return {
    role: text(you["role"]),
    robots: list(value["robots"])
      .map(parseRobot)
      .filter((robot) => robot !== null),
    notices: list(value["notices"])
      .map(parseNotice)
      .filter((notice) => notice !== null),
  };
}

export function parseStopReplies(value: unknown): readonly StopReply[] | null {
  if (!isRecord(value) || !Array.isArray(value["robots"])) return null;
  return list(value["robots"]).flatMap((each) =>
    isRecord(each) && text(each["name"]) !== ""
      ? [
          {
            name: text(each["name"]),
            delivered: each["delivered"] === true,
            kept: each["kept"] === true,
            detail: text(each["detail"]),
          },
        ]
      : [],
  );
}

/** Robots of other consoles that are reached under the page's own address, as behind one entry. */
export function robotsNearby(robots: readonly FleetRobot[], page: string): FleetRobot[] {
  const { origin } = new URL(page);
  return robots.filter(
    ({ console, url }) => console !== "" && URL.canParse(url, page) && new URL(url, page).origin === origin,
  );
}

function parseRobot(value: unknown): FleetRobot | null {
  if (!isRecord(value) || text(value["name"]) === "" || text(value["url"]) === "") return null;
  const people = list(value["participants"]).map(personName);
  return {
    name: text(value["name"]),
    label: text(value["label"]),
    url: text(value["url"]),
    link: value["link"] === "up" || value["link"] === "down" ? value["link"] : "unknown",
    detail: text(value["detail"]),
    linkAgeMs: number(value["link_age_ms"]),
    event: number(value["event"]) ?? 0,
    stopped: value["stopped"] === true,
    stopBy: text(value["stop_by"]),
    stopReason: text(value["stop_reason"]),
    driver: text(value["driver"]),
    mayDrive: value["role_may_drive"] === true,
    people: people.filter((name) => name !== ""),
    peopleCount: number(value["participant_count"]) ?? people.length,
    feedbackAgeMs: number(value["feedback_age_ms"]),
    gap: number(value["gap"]),
    tolerance: number(value["tolerance"]),
    recording: value["recording"] === true,
    eventRate: number(value["event_rate"]) ?? 0,
    faults: list(value["faults"]).map(text).filter(Boolean),
    console: text(value["console"]),
    trouble: text(value["trouble"]),
    hasPicture: value["has_picture"] !== false,
  };
}

function parseNotice(value: unknown): FleetNotice | null {
  if (!isRecord(value) || text(value["text"]) === "") return null;
  return { level: value["level"] === "error" ? "error" : "warning", text: text(value["text"]) };
}

function personName(value: unknown): string {
  return isRecord(value) ? text(value["name"]) : text(value);
}

function text(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function number(value: unknown): number | null {
  return typeof value === "number" && Number.isFinite(value) ? value : null;
}

function list(value: unknown): readonly unknown[] {
  return Array.isArray(value) ? (value as unknown[]) : [];
}
