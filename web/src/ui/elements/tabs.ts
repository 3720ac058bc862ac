import { h, setData, setHidden, setText, type Panel } from "./dom";

/** One page of several in the same place. */
export interface Tab {
  readonly name: string;
  readonly panels: readonly Panel[];
  /** What stands beside the name; "" for nothing. */
  badge(): string;
  /** Whether the badge is news. */
  calls(): boolean;
}

interface ShownTab {
  readonly tab: Tab;
  readonly button: HTMLButtonElement;
  readonly badge: HTMLElement;
  readonly page: HTMLElement;
}

/** Several pages, one of them shown (WAI-ARIA tabs: arrows move between them). */
export class Tabs implements Panel {
  readonly element: HTMLElement;
  private readonly shown: readonly ShownTab[];
  private current = 0;

  constructor(label: string, tabs: readonly Tab[]) {
    this.shown = tabs.map((tab, index) => this.createTab(tab, index));
    const list = h("div", "tab-list", { role: "tablist", "aria-label": label });
    list.append(...this.shown.map((tab) => tab.button));
    list.addEventListener("keydown", (event) => this.arrow(event));
    this.element = h("div", "details", {}, list, ...this.shown.map((tab) => tab.page));
    this.select(0);
  }

  isShown(name: string): boolean {
    return this.shown[this.current]?.tab.name === name && this.element.checkVisibility();
  }

  select(index: number): void {
    this.current = index;
    for (const [at, tab] of this.shown.entries()) {
      tab.button.setAttribute("aria-selected", String(at === index));
      tab.button.tabIndex = at === index ? 0 : -1;
      setHidden(tab.page, at !== index);
    }
    if (this.element.isConnected) this.update(performance.now());
  }

  /** Only what is shown is kept current. */
  update(now: number): void {
    for (const { tab, button, badge } of this.shown) {
      setText(badge, tab.badge());
      setHidden(badge, tab.badge() === "");
      setData(button, "calls", String(tab.calls()));
    }
    for (const panel of this.shown[this.current]?.tab.panels ?? []) panel.update(now);
  }

  private createTab(tab: Tab, index: number): ShownTab {
    const id = `tab-${tab.name.toLowerCase()}`;
    const badge = h("span", "tab-badge");
    const button = h("button", "tab", { type: "button", role: "tab", id, "aria-controls": `${id}-page` });
    button.append(tab.name, badge);
    button.addEventListener("click", () => this.select(index));
    const page = h("div", "tab-page", { role: "tabpanel", id: `${id}-page`, "aria-labelledby": id });
    page.dataset["tab"] = tab.name.toLowerCase();
    page.append(...tab.panels.map((panel) => panel.element));
    return { tab, button, badge, page };
  }

  private arrow(event: KeyboardEvent): void {
    if (event.defaultPrevented) return; // the key drives
    const step = event.code === "ArrowRight" ? 1 : event.code === "ArrowLeft" ? -1 : 0;
    if (step === 0) return;
    this.select((this.current + step + this.shown.length) % this.shown.length);
    this.shown[this.current]?.button.focus();
  }
}
