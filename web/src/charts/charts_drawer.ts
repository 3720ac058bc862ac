import type { ChartSampler } from "./chart_sampler";
import { chartCsv } from "./chart_csv";
import { chartWindow, newestTime } from "./chart_ring";
import { redrawMs } from "./chart_scale";
import { button, h, setData, setHidden, setPressed, setText, type Panel } from "../ui/elements/dom";
import { chartPicture } from "./chart_image";
import type { ChartStack } from "./chart_stack";
import type { WaySource } from "./way_figures";
import { saveFile } from "../ui/elements/save_file";

const RANGES = [
  { seconds: 30, label: "30 s" },
  { seconds: 120, label: "2 min" },
  { seconds: 600, label: "10 min" },
] as const;

/** The live charts beside the pictures. Nothing is drawn while it is closed. */
export class ChartsDrawer implements Panel {
  readonly element: HTMLElement;
  private readonly place = h("div", "charts-place", { tabindex: "0", role: "group", "aria-label": "Charts" }); // scrolls where the window is low
  private readonly words = h("span", "charts-words", { role: "status" });
  private readonly freezeButton = toolButton("Freeze", "F", () => this.freeze());
  private readonly rangeButtons: readonly HTMLButtonElement[];
  private stack: ChartStack | null = null;
  private seconds = 30;
  private frozenAt: number | null = null; // s since 1970
  private drawnMs = -Infinity;
  private open = false;

  /** `toggled`: the page makes room, or takes it back. */
  constructor(
    private readonly sampler: ChartSampler,
    private readonly ways: WaySource,
    private readonly toggled: (open: boolean) => unknown,
  ) {
    this.rangeButtons = RANGES.map(({ seconds, label }) =>
      button("segment", label, () => this.range(seconds)),
    );
    const ranges = h("span", "segments", { role: "group", "aria-label": "Time shown" }, ...this.rangeButtons);
    const saver = toolButton("Save", "X", () => void this.save());
    saver.title = "Save what is shown as CSV and as PNG";
    const close = toolButton("Close", "C", () => this.toggle());
    const tools = h("div", "charts-tools", {}, ranges, this.freezeButton, saver, close);
    const head = h(
      "header",
      "charts-head",
      {},
      h("h2", "charts-title", {}, "Live charts"),
      tools,
      this.words,
    );
    this.element = h("section", "charts", { "aria-label": "Live charts" }, head, this.place);
    setHidden(this.element, true);
    new ResizeObserver(() => (this.drawnMs = -Infinity)).observe(this.place);
  }

  get isOpen(): boolean {
    return this.open;
  }

  toggle(): void {
    this.open = !this.open;
    setHidden(this.element, !this.open);
    this.toggled(this.open);
    if (this.open) void this.load();
    else this.unload();
  }

  freeze(): void {
    if (!this.open) return;
    this.frozenAt = this.frozenAt === null ? newestTime(this.sampler.ring) : null;
    this.drawnMs = -Infinity;
  }

  /** What is shown, as two files; opens the drawer if need be. */
  async save(): Promise<void> {
    if (!this.open) this.toggle();
    const stack = await this.load();
    if (stack === null) return;
    this.draw(stack);
    const { from, until } = this.span();
    const name = `lockstep-${new Date(until * 1000).toISOString().slice(0, 19).replaceAll(":", "")}`;
    const csv = chartCsv(chartWindow(this.sampler.ring, from, until));
    saveFile(new Blob([csv], { type: "text/csv" }), `${name}.csv`);
    saveFile(await chartPicture(stack.all(), `Lockstep · ${clock(from)} to ${clock(until)}`), `${name}.png`);
    setText(this.words, `Saved ${name}.csv and .png`);
  }

  update(now: number): void {
    if (!this.open) return;
    setPressed(this.freezeButton, this.frozenAt !== null);
    setData(this.element, "frozen", String(this.frozenAt !== null));
    for (const [at, { seconds }] of RANGES.entries()) {
      const choice = this.rangeButtons[at];
      if (choice !== undefined) setPressed(choice, seconds === this.seconds);
    }
    const due = this.frozenAt === null && now - this.drawnMs >= redrawMs(this.seconds);
    if (this.stack === null || (!due && this.drawnMs !== -Infinity)) return;
    this.drawnMs = now;
    this.draw(this.stack);
  }

  private range(seconds: number): void {
    this.seconds = seconds;
    this.drawnMs = -Infinity;
  }

  private span(): { from: number; until: number } {
    const until = this.frozenAt ?? newestTime(this.sampler.ring) ?? Date.now() / 1000;
    return { from: until - this.seconds, until };
  }

  private draw(stack: ChartStack): void {
    const { from, until } = this.span();
    stack.show(from, until);
  }

  /** The charts' code comes when they are first wanted. Null when they were closed meanwhile. */
  private async load(): Promise<ChartStack | null> {
    if (this.stack !== null) return this.stack;
    try {
      const { ChartStack: Stack } = await import("./chart_stack");
      if (!this.open) return null;
      this.stack ??= new Stack(this.sampler.ring, this.ways);
      this.place.replaceChildren(this.stack.element);
      this.drawnMs = -Infinity;
      return this.stack;
    } catch {
      setText(this.words, "The charts could not be loaded. Check the connection to the console.");
      return null;
    }
  }

  private unload(): void {
    this.stack?.close();
    this.stack = null;
    this.frozenAt = null;
    setText(this.words, "");
  }
}

function toolButton(label: string, keyName: string, onclick: () => void): HTMLButtonElement {
  const found = button("charts-button", label, onclick);
  found.append(h("kbd", "", {}, keyName));
  found.setAttribute("aria-keyshortcuts", keyName);
  return found;
}

function clock(seconds: number): string {
  return new Date(seconds * 1000).toTimeString().slice(0, 8);
}
