import { parseFleetAudit, type FleetAuditEntry } from "../fleet_audit";
import type { ConsoleApi } from "../../transport/signalling/console_api";
import { createAuditView, type AuditAnswer } from "../../ui/session/audit/audit_view";
import { h } from "../../ui/elements/dom";
import type { SheetContent } from "../../ui/elements/sheet";

const LIMIT_MS = 8000;
const LINES = 500; // the most that the console gives

/** What happened at all robots, other consoles' too. For supervisors. */
export function createFleetAudit(api: ConsoleApi): SheetContent {
  const ask = async (): Promise<AuditAnswer<FleetAuditEntry>> => {
    const limit = AbortSignal.timeout(LIMIT_MS);
    const answer = await api.json("GET", `/api/fleet/audit?limit=${LINES}`, undefined, limit);
    const { entries, trouble } = parseFleetAudit(answer);
    return {
      entries,
      trouble: trouble === "" ? "" : `Lines of other consoles may be missing: ${trouble}.`,
    };
  };
  return createAuditView<FleetAuditEntry>({
    title: "Audit trail of all robots",
    className: "of-fleet",
    second: ["Robot"],
    cells: (entry) => [robotCell(entry)],
    newest: ask,
    hasOlder: () => false, // each robot's own page has all of its lines
    older: ask,
    merged: (_known, answer) => answer,
  });
}

function robotCell({ robot, console }: FleetAuditEntry): HTMLElement {
  const title = console === "" ? "at this console" : `at ${console}`;
  return h("td", "audit-robot", { title }, robot);
}
