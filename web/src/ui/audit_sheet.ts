import { mergeAudit, type AuditEntry } from "../core/audit";
import { AUDIT_LINES, type SessionApi } from "../rtc/session_api";
import { createAuditView, type AuditAnswer } from "./audit_view";
import type { SheetContent } from "./sheet";

/** What happened at this robot. */
export function createAuditSheet(api: SessionApi): SheetContent {
  const ask = async (after: number): Promise<AuditAnswer<AuditEntry>> => {
    const { entries, trouble } = await api.audit(after);
    const words = trouble === "" ? "" : `The console cannot write the trail at present: ${trouble}.`;
    return { entries, trouble: words };
  };
  const oldest = (known: readonly AuditEntry[]): number => known.at(-1)?.n ?? 1;
  return createAuditView<AuditEntry>({
    title: "Audit trail",
    className: "",
    second: [],
    cells: () => [],
    newest: (known) => ask(known[0]?.n ?? -1),
    hasOlder: (known) => oldest(known) > 1,
    older: (known) => ask(Math.max(0, oldest(known) - 1 - AUDIT_LINES)),
    merged: mergeAudit,
  });
}
