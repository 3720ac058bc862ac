import {
  AUDIT_GROUPS,
  auditWords,
  countGroup,
  filterAudit,
  mergeAudit,
  type AuditEntry,
  type AuditGroup,
} from "../core/audit";
import { AUDIT_LINES, troubleWords, type SessionApi } from "../rtc/session_api";
import { button, grouped, h, setHidden, setPressed, setText } from "./dom";
import type { SheetContent } from "./sheet";

const REFRESH_MS = 2000;
const SHOWN = 200; // rows at first, and more at each asking

/** Who drove when, and what was refused, stopped and handed over; it follows what happens. */
export function createAuditSheet(api: SessionApi): SheetContent {
  const sheet = new AuditSheet(api);
  return {
    name: "audit",
    title: "Audit trail",
    element: sheet.element,
    opened: () => sheet.open(),
    closed: () => sheet.close(),
  };
}

class AuditSheet {
  readonly element: HTMLElement;
  private readonly state = h("p", "audit-state", { role: "status" });
  private readonly rows = h("tbody");
  private readonly table = h(
    "table",
    "audit-table",
    {},
    auditHead(["Time", "Event", "Kind", "Who", "What"]),
    this.rows,
  );
  private readonly more = button("quiet-button", "Show older", () => void this.showOlder());
  private readonly scroll: HTMLElement;
  private readonly chips: ReadonlyMap<AuditGroup, HTMLButtonElement>;
  private group: AuditGroup = "all";
  private entries: readonly AuditEntry[] = []; // newest first
  private limit = SHOWN;
  private trouble = "";
  private loaded = false;
  private opening = 0; // counts up; an answer to an earlier one is not shown
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly api: SessionApi) {
    const names = Object.keys(AUDIT_GROUPS) as AuditGroup[];
    this.chips = new Map(names.map((group) => [group, this.createChip(group)]));
    const filters = h(
      "div",
      "audit-filters",
      { role: "group", "aria-label": "Kinds" },
      ...this.chips.values(),
    );
    this.scroll = h(
      "div",
      "audit-scroll",
      { tabindex: "0", "aria-label": "Audit trail" },
      this.table,
      this.more,
    );
    this.element = h("div", "audit-body", {}, filters, this.state, this.scroll);
  }

  open(): void {
    this.loaded = false;
    this.trouble = "";
    this.limit = SHOWN;
    this.show();
    void this.follow(++this.opening);
  }

  close(): void {
    this.opening += 1;
    clearTimeout(this.timer);
  }

  private async follow(opening: number): Promise<void> {
    await this.ask(this.entries[0]?.n ?? -1);
    if (opening !== this.opening) return;
    this.show();
    this.timer = setTimeout(() => void this.follow(opening), REFRESH_MS);
  }

  private async showOlder(): Promise<void> {
    this.limit += SHOWN;
    const oldest = this.entries.at(-1)?.n ?? 1;
    if (this.limit > this.entries.length && oldest > 1) await this.ask(Math.max(0, oldest - 1 - AUDIT_LINES));
    this.show();
  }

  private async ask(after: number): Promise<void> {
    try {
      const { entries, trouble } = await this.api.audit(after);
      this.trouble = trouble === "" ? "" : `The console cannot write the trail at present: ${trouble}.`;
      this.loaded = true;
      this.entries = mergeAudit(this.entries, entries);
    } catch (error) {
      const old = this.entries.length === 0 ? "" : " What is below is as it was.";
      this.trouble = `${troubleWords(error)}${old}`;
    }
  }

  private show(): void {
    const found = filterAudit(this.entries, this.group);
    for (const [name, chip] of this.chips) {
      setPressed(chip, name === this.group);
      setText(chip, `${AUDIT_GROUPS[name]} ${countGroup(this.entries, name)}`);
    }
    setText(this.state, this.trouble || this.emptyWords(found.length));
    setHidden(this.state, this.state.textContent === "");
    this.state.dataset["tone"] = this.trouble === "" ? "calm" : "bad";
    setHidden(this.table, found.length === 0);
    setHidden(this.more, found.length <= this.limit && (this.entries.at(-1)?.n ?? 1) <= 1);
    this.rows.replaceChildren(...found.slice(0, this.limit).map((entry) => auditRow(entry)));
  }

  private emptyWords(count: number): string {
    if (!this.loaded && this.entries.length === 0) return "Loading…";
    if (count > 0) return "";
    return this.entries.length === 0 ? "Nothing was recorded yet." : "Nothing of this kind was recorded.";
  }

  private createChip(name: AuditGroup): HTMLButtonElement {
    return button("chip-button audit-chip", AUDIT_GROUPS[name], () => {
      this.group = name;
      this.limit = SHOWN;
      this.show();
      this.scroll.scrollTop = 0;
    });
  }
}

export function auditHead(names: readonly string[]): HTMLElement {
  const cells = names.map((name) => h("th", "", { scope: "col" }, name));
  return h("thead", "", {}, h("tr", "", {}, ...cells));
}

/** A line of the table; `second` are cells behind the time. */
export function auditRow(entry: AuditEntry, ...second: HTMLElement[]): HTMLElement {
  const when = new Date(entry.time * 1000);
  const day = when.toDateString() === new Date().toDateString() ? "" : `${when.toISOString().slice(5, 10)} `;
  const time = h("time", "", { datetime: when.toISOString(), title: when.toString() });
  time.append(day + when.toTimeString().slice(0, 8));
  return h(
    "tr",
    "audit-row",
    { "data-kind": entry.kind },
    h("td", "audit-time", {}, time),
    ...second,
    h("td", "audit-event", {}, entry.event === 0 ? "–" : grouped(entry.event)),
    h("td", "audit-kind", {}, entry.kind.replace("_", " ")),
    h("td", "audit-who", {}, ...whoOf(entry)),
    h("td", "audit-what", {}, auditWords(entry)),
  );
}

function whoOf({ who, role }: AuditEntry): (Node | string)[] {
  if (who === "") return [];
  return role === "" ? [who] : [who, h("span", "audit-role", {}, ` ${role}`)];
}
