import {
  AUDIT_GROUPS,
  auditWords,
  countGroup,
  filterAudit,
  mergeAudit,
  type AuditEntry,
  type AuditGroup,
} from "../core/audit";
import { troubleWords, type SessionApi } from "../rtc/session_api";
import { button, grouped, h, setHidden, setPressed, setText } from "./dom";
import type { SheetContent } from "./sheet";

const REFRESH_MS = 2000;
const KEPT = 5000; // lines, as many as the console keeps
const SHOWN = 200; // rows at first, and more at each asking

/** Who drove when, and what was refused, stopped and handed over; it follows what happens. */
export function createAuditSheet(api: SessionApi): SheetContent {
  const filters = h("div", "audit-filters", { role: "group", "aria-label": "Kinds" });
  const state = h("p", "audit-state", { role: "status" });
  const rows = h("tbody");
  const table = h("table", "audit-table", {}, headRow(), rows);
  const more = button("quiet-button", "Show older", () => {
    limit += SHOWN;
    show();
  });
  const scroll = h("div", "audit-scroll", { tabindex: "0", "aria-label": "Audit trail" }, table, more);
  const names = Object.keys(AUDIT_GROUPS) as AuditGroup[];
  const chips = new Map(names.map((group) => [group, createChip(group)]));
  let group: AuditGroup = "all";
  let entries: AuditEntry[] = [];
  let limit = SHOWN;
  let trouble: string | null = null;
  let loaded = false;
  let timer: ReturnType<typeof setTimeout> | undefined;
  filters.append(...chips.values());

  return {
    name: "audit",
    title: "Audit trail",
    element: h("div", "audit-body", {}, filters, state, scroll),
    opened() {
      loaded = false;
      trouble = null;
      limit = SHOWN;
      show();
      void refresh();
    },
    closed() {
      clearTimeout(timer);
      timer = undefined;
    },
  };

  function createChip(name: AuditGroup): HTMLButtonElement {
    return button("chip-button audit-chip", AUDIT_GROUPS[name], () => {
      group = name;
      limit = SHOWN;
      show();
      scroll.scrollTop = 0;
    });
  }

  async function refresh(): Promise<void> {
    const mine = setTimeout(() => undefined);
    timer = mine;
    try {
      const fresh = await api.audit(entries[0]?.n ?? -1);
      trouble = null;
      loaded = true;
      if (fresh.length > 0) entries = mergeAudit(entries, fresh, KEPT);
    } catch (error) {
      trouble = troubleWords(error);
    }
    if (timer !== mine) return; // closed, or opened again, meanwhile
    show();
    timer = setTimeout(() => void refresh(), REFRESH_MS);
  }

  function show(): void {
    const found = filterAudit(entries, group);
    for (const [name, chip] of chips) {
      setPressed(chip, name === group);
      setText(chip, `${AUDIT_GROUPS[name]} ${countGroup(entries, name)}`);
    }
    setText(state, stateWords(found.length));
    setHidden(state, state.textContent === "");
    state.dataset["tone"] = trouble === null ? "calm" : "bad";
    setHidden(table, found.length === 0);
    setHidden(more, found.length <= limit);
    rows.replaceChildren(...found.slice(0, limit).map(rowOf));
  }

  function stateWords(count: number): string {
    if (trouble !== null) return `${trouble} The trail below is as it was.`;
    if (!loaded && entries.length === 0) return "Loading…";
    if (count > 0) return "";
    return entries.length === 0 ? "Nothing was recorded yet." : "Nothing of this kind was recorded.";
  }
}

function headRow(): HTMLElement {
  const cells = ["Time", "Event", "Kind", "Who", "What"].map((name) => h("th", "", { scope: "col" }, name));
  return h("thead", "", {}, h("tr", "", {}, ...cells));
}

function whoOf({ who, role }: AuditEntry): (Node | string)[] {
  if (who === "") return [];
  return role === "" ? [who] : [who, h("span", "audit-role", {}, ` ${role}`)];
}

function rowOf(entry: AuditEntry): HTMLElement {
  const when = new Date(entry.time * 1000);
  const time = h("time", "", { datetime: when.toISOString(), title: when.toString() });
  const day = when.toDateString() === new Date().toDateString() ? "" : `${when.toISOString().slice(5, 10)} `;
  time.append(day + when.toTimeString().slice(0, 8));
  return h(
    "tr",
    "audit-row",
    { "data-kind": entry.kind },
    h("td", "audit-time", {}, time),
    h("td", "audit-event", {}, entry.event === 0 ? "–" : grouped(entry.event)),
    h("td", "audit-kind", {}, entry.kind.replace("_", " ")),
    h("td", "audit-who", {}, ...whoOf(entry)),
    h("td", "audit-what", {}, auditWords(entry)),
  );
}
