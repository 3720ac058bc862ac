import { auditEntry, type AuditEntry } from "../session/audit_trail";
import { isRecord } from "../protocol/schema_check";

/** One line of the audit of some robot's console (docs/console-api.md). */
export interface FleetAuditEntry extends AuditEntry {
  readonly robot: string;
  readonly console: string; // its name; "" for the one that was asked
}

export interface FleetAuditPage {
  readonly entries: readonly FleetAuditEntry[]; // newest first
  readonly trouble: string; // why lines of other consoles may be missing; "" when none are
}

/** What an answer says; what is no line is left out. */
export function parseFleetAudit(answer: unknown): FleetAuditPage {
  const records: unknown = isRecord(answer) ? answer["records"] : undefined;
  const entries = (Array.isArray(records) ? records : []).flatMap((each: unknown) => entryOf(each));
  const isAll = isRecord(answer) && answer["complete"] === true;
  const detail = isRecord(answer) && typeof answer["detail"] === "string" ? answer["detail"] : "";
  return { entries: entries.reverse(), trouble: isAll ? "" : detail || "the others did not answer" };
}

function entryOf(value: unknown): FleetAuditEntry[] {
  if (!isRecord(value) || !isRecord(value["record"])) return [];
  const { robot, console } = value;
  if (typeof robot !== "string" || typeof console !== "string") return [];
  return [{ ...auditEntry(value["record"]), robot, console }];
}
