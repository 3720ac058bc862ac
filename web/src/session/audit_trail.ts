import { isRecord } from "../protocol/schema_check";

/** One line of the console's audit trail (docs/console-api.md). Text that is not there is empty. */
export interface AuditEntry {
  readonly n: number; // counts up without gaps
  readonly time: number; // s since 1970, the console's clock
  readonly event: number; // 0 before the robot was reached
  readonly kind: string;
  readonly who: string;
  readonly role: string;
  readonly what: string;
  readonly detail: string;
  readonly count: number; // of the same, merged
}

const KEPT = 5000; // lines, as many as the console keeps at hand

/** Kinds that are looked at together. */
export type AuditGroup = "all" | "driving" | "stops" | "refusals" | "people" | "notes" | "robot";

export const AUDIT_GROUPS: Readonly<Record<AuditGroup, string>> = {
  all: "All",
  driving: "Driving",
  stops: "Stops",
  refusals: "Refusals",
  people: "People",
  notes: "Notes",
  robot: "Robot and console",
};

const KINDS: ReadonlyMap<string, AuditGroup> = new Map([
  ["seat", "driving"],
  ["claim", "driving"],
  ["stop", "stops"],
  ["reset", "stops"],
  ["refusal", "refusals"],
  ["joined", "people"],
  ["left", "people"],
  ["invitation", "people"],
  ["revocation", "people"],
  ["renamed", "people"],
  ["note", "notes"],
]);

/** One answer of the console. */
export interface AuditPage {
  readonly entries: readonly AuditEntry[];
  readonly trouble: string; // why it cannot be written at present; "" when it can
}

/** What an answer says; what is no line is left out. */
export function parseAudit(answer: unknown): AuditPage {
  const trouble = isRecord(answer) ? answer["trouble"] : undefined;
  return { entries: entriesOf(answer), trouble: typeof trouble === "string" ? trouble : "" };
}

function entriesOf(answer: unknown): AuditEntry[] {
  const found = isRecord(answer) ? answer["records"] : undefined;
  return Array.isArray(found)
    ? found
        .filter(isRecord)
        .map(auditEntry)
        .filter((entry) => entry.n > 0)
    : [];
}

/** Newest first, each once, bounded. */
export function mergeAudit(
  known: readonly AuditEntry[],
  fresh: readonly AuditEntry[],
  limit = KEPT,
): AuditEntry[] {
  const byNumber = new Map([...known, ...fresh].map((entry) => [entry.n, entry]));
  return [...byNumber.values()].sort((one, other) => other.n - one.n).slice(0, limit);
}

export function auditGroup(kind: string): AuditGroup {
  return KINDS.get(kind) ?? "robot";
}

export function filterAudit<Entry extends AuditEntry>(entries: readonly Entry[], group: AuditGroup): Entry[] {
  return entries.filter((entry) => group === "all" || auditGroup(entry.kind) === group);
}

export function countGroup(entries: readonly AuditEntry[], group: AuditGroup): number {
  return filterAudit(entries, group).length;
}

/** What happened, in one line. */
export function auditLabel(entry: AuditEntry): string {
  const words = [entry.what, entry.detail].filter((text) => text !== "").join(": ");
  return entry.count > 1 ? `${words} ×${entry.count}` : words;
}

/** A record as the console writes it; what is missing is empty. */
export function auditEntry(record: Record<string, unknown>): AuditEntry {
  const number = (name: string): number => (typeof record[name] === "number" ? record[name] : 0);
  const text = (name: string): string => (typeof record[name] === "string" ? record[name] : "");
  return {
    n: number("n"),
    time: number("time"),
    event: number("event"),
    kind: text("kind"),
    who: text("who"),
    role: text("role"),
    what: text("what"),
    detail: text("detail"),
    count: Math.max(1, number("count")),
  };
}
