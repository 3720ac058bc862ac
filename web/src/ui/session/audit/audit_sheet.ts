import { mergeAudit, type AuditEntry, type AuditPage } from "../../../session/audit_trail";
import { AUDIT_LINES, type SessionApi } from "../../../transport/signalling/session_api";
import { createAuditView, type AuditAnswer } from "./audit_view";
import type { SheetContent } from "../../elements/sheet";

/** What happened at this robot. */
export function createAuditSheet(api: SessionApi): SheetContent {
  let isWhole = false; // nothing older than what is known is kept at hand
  const told = ({ entries, trouble }: AuditPage): AuditAnswer<AuditEntry> => {
    const words = trouble === "" ? "" : `The console cannot write the trail at present: ${trouble}.`;
    return { entries, trouble: words };
  };
  const oldest = (known: readonly AuditEntry[]): number => known.at(-1)?.n ?? 1;
  return createAuditView<AuditEntry>({
    title: "Audit trail",
    className: "",
    second: [],
    cells: () => [],
    newest: async (known) => told(await api.audit(known[0]?.n ?? -1)),
    hasOlder: (known) => !isWhole && oldest(known) > 1,
    older: async (known) => {
      const found = await api.olderAudit(oldest(known));
      isWhole = found.entries.length < AUDIT_LINES;
      return told(found);
    },
    merged: mergeAudit,
  });
}
