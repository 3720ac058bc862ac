import { AUDIT_GROUPS, countGroup, filterAudit, type AuditGroup } from "../core/audit";
import { parseFleetAudit, type FleetAuditEntry } from "../core/fleet_audit";
import type { ConsoleApi } from "../rtc/console_api";
import { troubleWords } from "../rtc/session_api";
import { auditHead, auditRow } from "../ui/audit_sheet";
import { button, h, setHidden, setPressed, setText } from "../ui/dom";
import type { SheetContent } from "../ui/sheet";

const REFRESH_MS = 2000;
const LIMIT_MS = 8000;
const LINES = 500; // the most that the console gives

/** What happened at all robots, other consoles' too; it follows what happens. For supervisors. */
export function createFleetAudit(api: ConsoleApi): SheetContent {
  const sheet = new FleetAudit(api);
  return {
    name: "audit",
    title: "Audit trail of all robots",
    element: sheet.element,
    opened: () => sheet.open(),
    closed: () => sheet.close(),
  };
}

class FleetAudit {
  readonly element: HTMLElement;
  private readonly state = h("p", "audit-state", { role: "status" });
  private readonly rows = h("tbody");
  private readonly table = h(
    "table",
    "audit-table of-fleet",
    {},
    auditHead(["Time", "Robot", "Event", "Kind", "Who", "What"]),
    this.rows,
  );
  private readonly chips: ReadonlyMap<AuditGroup, HTMLButtonElement>;
  private group: AuditGroup = "all";
  private entries: readonly FleetAuditEntry[] | null = null; // null: not told yet
  private trouble = "";
  private opening = 0; // counts up; an answer to an earlier one is not shown
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly api: ConsoleApi) {
    const names = Object.keys(AUDIT_GROUPS) as AuditGroup[];
    this.chips = new Map(names.map((group) => [group, this.createChip(group)]));
    this.element = h(
      "div",
      "audit-body",
      {},
      h("div", "audit-filters", { role: "group", "aria-label": "Kinds" }, ...this.chips.values()),
      this.state,
      h("div", "audit-scroll", { tabindex: "0", "aria-label": "Audit trail" }, this.table),
    );
  }

  open(): void {
    this.show();
    void this.follow(++this.opening);
  }

  close(): void {
    this.opening += 1;
    clearTimeout(this.timer);
  }

  private async follow(opening: number): Promise<void> {
    await this.ask();
    if (opening !== this.opening) return;
    this.show();
    this.timer = setTimeout(() => void this.follow(opening), REFRESH_MS);
  }

  private async ask(): Promise<void> {
    try {
      const path = `/api/fleet/audit?limit=${LINES}`;
      const page = parseFleetAudit(
        await this.api.json("GET", path, undefined, AbortSignal.timeout(LIMIT_MS)),
      );
      this.entries = page.entries;
      this.trouble = page.trouble === "" ? "" : `Lines of other consoles may be missing: ${page.trouble}.`;
    } catch (error) {
      this.trouble = `${troubleWords(error)}${this.entries === null ? "" : " What is below is as it was."}`;
    }
  }

  private show(): void {
    const entries = this.entries ?? [];
    const found = filterAudit(entries, this.group);
    for (const [name, chip] of this.chips) {
      setPressed(chip, name === this.group);
      setText(chip, `${AUDIT_GROUPS[name]} ${countGroup(entries, name)}`);
    }
    setText(this.state, this.trouble || this.emptyWords(found.length));
    setHidden(this.state, this.state.textContent === "");
    this.state.dataset["tone"] = this.trouble === "" ? "calm" : "bad";
    setHidden(this.table, found.length === 0);
    this.rows.replaceChildren(...found.map((entry) => auditRow(entry, robotCell(entry))));
  }

  private emptyWords(count: number): string {
    if (this.entries === null) return "Loading…";
    if (count > 0) return "";
    return this.entries.length === 0 ? "Nothing was recorded yet." : "Nothing of this kind was recorded.";
  }

  private createChip(name: AuditGroup): HTMLButtonElement {
    return button("chip-button audit-chip", AUDIT_GROUPS[name], () => {
      this.group = name;
      this.show();
    });
  }
}

function robotCell({ robot, console }: FleetAuditEntry): HTMLElement {
  const title = console === "" ? "at this console" : `at ${console}`;
  return h("td", "audit-robot", { title }, robot);
}
