import {
  AUDIT_GROUPS,
  countGroup,
  filterAudit,
  type AuditEntry,
  type AuditGroup,
} from "../../../session/audit_trail";
import { requestErrorLabel } from "../../../transport/signalling/session_api";
import { auditHead, auditRow } from "./audit_table";
import { button, h, setHidden, setPressed, setText } from "../../elements/dom";
import type { SheetContent } from "../../elements/sheet";

const REFRESH_MS = 2000;
const SHOWN = 200; // rows at first, and more at each asking

/** Lines, newest first; `trouble`: what is wrong with them, in words; "" when nothing is. */
export interface AuditAnswer<Entry extends AuditEntry> {
  readonly entries: readonly Entry[];
  readonly trouble: string;
}

/** Where the lines come from. What it asks for rejects with ConsoleError. */
export interface AuditSource<Entry extends AuditEntry> {
  readonly title: string;
  readonly className: string; // of the table
  readonly second: readonly string[]; // heads of the columns behind the time
  /** Those cells of a line. */
  cells(entry: Entry): readonly HTMLElement[];
  /** What there is now; of lines that are known already it may leave out some. */
  newest(known: readonly Entry[]): Promise<AuditAnswer<Entry>>;
  /** Whether there are lines older than those known. */
  hasOlder(known: readonly Entry[]): boolean;
  older(known: readonly Entry[]): Promise<AuditAnswer<Entry>>;
  /** All lines, after an answer. */
  merged(known: readonly Entry[], answer: readonly Entry[]): readonly Entry[];
}

/** A dialogue with who drove when, and what was refused, stopped and handed over; it follows what happens. */
export function createAuditView<Entry extends AuditEntry>(source: AuditSource<Entry>): SheetContent {
  const view = new AuditView(source);
  return {
    name: "audit",
    title: source.title,
    element: view.element,
    opened: () => view.open(),
    closed: () => view.close(),
  };
}

class AuditView<Entry extends AuditEntry> {
  readonly element: HTMLElement;
  private readonly state = h("p", "audit-state", { role: "status" });
  private readonly rows = h("tbody");
  private readonly table: HTMLElement;
  private readonly more = button("quiet-button", "Show older", () => void this.showOlder());
  private readonly scroll: HTMLElement;
  private readonly chips: ReadonlyMap<AuditGroup, HTMLButtonElement>;
  private group: AuditGroup = "all";
  private entries: readonly Entry[] = []; // newest first
  private limit = SHOWN;
  private trouble = "";
  private isLoaded = false;
  private shownKey = "";
  private opening = 0; // counts up; an answer to an earlier one is not shown
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly source: AuditSource<Entry>) {
    const names = Object.keys(AUDIT_GROUPS) as AuditGroup[];
    this.chips = new Map(names.map((group) => [group, this.createChip(group)]));
    const head = auditHead(["Time", ...source.second, "Event", "Kind", "Who", "What"]);
    this.table = h("table", `audit-table ${source.className}`.trim(), {}, head, this.rows);
    const filters = h(
      "div",
      "audit-filters",
      { role: "group", "aria-label": "Kinds" },
      ...this.chips.values(),
    );
    this.scroll = h(
      "div",
      "audit-scroll",
      { role: "region", tabindex: "0", "aria-label": "Audit trail" },
      this.table,
      this.more,
    );
    this.element = h("div", "audit-body", {}, filters, this.state, this.scroll);
  }

  open(): void {
    this.isLoaded = false;
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
    await this.took(this.source.newest(this.entries));
    if (opening !== this.opening) return;
    this.show();
    this.timer = setTimeout(() => void this.follow(opening), REFRESH_MS);
  }

  private async showOlder(): Promise<void> {
    this.limit += SHOWN;
    if (this.limit > this.entries.length && this.source.hasOlder(this.entries))
      await this.took(this.source.older(this.entries));
    this.show();
  }

  private async took(asked: Promise<AuditAnswer<Entry>>): Promise<void> {
    try {
      const { entries, trouble } = await asked;
      this.trouble = trouble;
      this.isLoaded = true;
      this.entries = this.source.merged(this.entries, entries);
    } catch (error) {
      const old = this.entries.length === 0 ? "" : " The list below may be out of date.";
      this.trouble = `${requestErrorLabel(error)}${old}`;
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
    setHidden(this.more, found.length <= this.limit && !this.source.hasOlder(this.entries));
    this.showRows(found.slice(0, this.limit));
  }

  /** Built anew only when they changed: somebody may be copying one. */
  private showRows(shown: readonly Entry[]): void {
    const [first, last] = [shown[0], shown.at(-1)];
    const key = [this.group, shown.length, first?.n, first?.time, last?.n, last?.time].join(" ");
    if (key === this.shownKey) return;
    this.shownKey = key;
    this.rows.replaceChildren(...shown.map((entry) => auditRow(entry, this.source.cells(entry))));
  }

  private emptyWords(count: number): string {
    if (!this.isLoaded && this.entries.length === 0) return "Loading…";
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
