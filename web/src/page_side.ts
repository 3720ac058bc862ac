import { ChartSampler } from "./chart_sampler";
import { ChartsDrawer } from "./charts/charts_drawer";
import type { ConsoleApp } from "./console_app";
import { readFragment } from "./core/fragment";
import type { PageAction } from "./core/page_keys";
import { replayHash } from "./core/replay_link";
import { countUnread, createUnread, markRead } from "./core/unread";
import { Pad } from "./input/pad";
import { PadStorage } from "./input/pad_storage";
import { watchPageKeys } from "./page_keys";
import type { ConsoleApi } from "./rtc/console_api";
import { SessionApi } from "./rtc/session_api";
import { createAuditSheet } from "./ui/audit_sheet";
import { createDelayPanel } from "./ui/delay_panel";
import type { Panel } from "./ui/dom";
import { createInviteSheet } from "./ui/invite_sheet";
import { createKeysSheet } from "./ui/keys_sheet";
import { createLogPanel } from "./ui/log_panel";
import { createNotesPanel } from "./ui/notes_panel";
import { createPadSheet } from "./ui/pad_sheet";
import { createPageTools, type PageTools } from "./ui/page_tools";
import { createPeoplePanel } from "./ui/people_panel";
import { createRecordButton } from "./ui/record_button";
import { createSettingsPanel } from "./ui/settings_panel";
import { Sheets, type SheetContent } from "./ui/sheet";
import { createStreamTable } from "./ui/stream_table";
import { Tabs } from "./ui/tabs";
import type { ViewBoard } from "./ui/view_board";

/** What a dialogue makes inert. The control seat, the banner and STOP stay in reach. */
const BEHIND_SHEETS = ".bar, .views, .rail, .arm, .axis-panel, .stick";

/** What stands beside the pictures and needs none: tabs, dialogues, charts, their buttons and keys. */
export class PageSide {
  readonly record: Panel;
  readonly tools: Panel;
  readonly tabs: Tabs;
  readonly charts: ChartsDrawer;
  readonly sheets: Sheets;
  private readonly unread = createUnread();
  private readonly pageTools: PageTools;
  private readonly session: SessionApi;
  private readonly keys = once(() => createKeysSheet(this.app));
  private readonly pads: () => SheetContent;
  private readonly inviting = once(() => createInviteSheet(this.app, this.session));
  private readonly auditing = once(() => createAuditSheet(this.session));

  /** `redraw`: at once, after something was pressed. */
  constructor(
    private readonly app: ConsoleApp,
    private readonly board: ViewBoard,
    root: HTMLElement,
    api: ConsoleApi,
    private readonly redraw: () => void,
  ) {
    const { controls } = app;
    const pad = (controls.pad ??= new Pad(controls.events, new PadStorage()));
    this.pads = once(() => createPadSheet(pad));
    this.session = new SessionApi(api);
    this.sheets = new Sheets(() => root.querySelectorAll<HTMLElement>(BEHIND_SHEETS));
    this.record = createRecordButton(app, this.session);
    this.pageTools = createPageTools({
      charts: () => this.act("charts"),
      keys: () => this.act("keys"),
      pads: () => this.act("pads"),
      scene: () => this.toggleScene(),
    });
    this.tools = {
      element: this.pageTools.bar,
      update: () => this.pageTools.update(app, board.sceneSwitch?.isOn === true),
    };
    this.tabs = this.createTabs();
    app.charts = new ChartSampler(app);
    this.charts = new ChartsDrawer(app.charts, (open) => root.classList.toggle("shows-charts", open));
    addEventListener("keydown", (event) => {
      if (event.code === "Escape") this.sheets.close();
    });
    watchPageKeys(app, (action) => this.act(action));
  }

  countNews(): number {
    const { notes, welcome } = this.app.state;
    return countUnread(this.unread, notes, welcome?.peer ?? null);
  }

  private act(action: PageAction): void {
    if (action === "keys") this.sheets.open(this.keys());
    else if (action === "pads") this.sheets.open(this.pads());
    else if (this.sheets.isOpen) return;
    else if (action === "charts") this.charts.toggle();
    else if (action === "freeze") this.charts.freeze();
    else void this.charts.save();
  }

  private toggleScene(): void {
    this.board.sceneSwitch?.toggle();
    this.redraw();
  }

  private createTabs(): Tabs {
    const { app } = this;
    const status = [
      { element: this.pageTools.details, update: () => undefined },
      createStreamTable(app),
      createDelayPanel(app, () => this.board.mainStream()),
      createSettingsPanel(app),
      createLogPanel(app),
    ];
    const people = createPeoplePanel(app, {
      invite: () => this.sheets.open(this.inviting()),
      audit: () => this.sheets.open(this.auditing()),
      recordings: openRecordings,
    });
    const notes = createNotesPanel(app);
    const reading: Panel = {
      element: notes.element,
      update: (now) => {
        notes.update(now);
        if (!document.hidden && notes.element.checkVisibility()) markRead(this.unread, app.state.notes);
      },
    };
    const news = (): number => this.countNews();
    const count = (): string => (app.state.participants.length > 0 ? `${app.state.participants.length}` : "");
    return new Tabs("Session", [
      { name: "Status", panels: status, badge: () => "", calls: () => false },
      { name: "People", panels: [people], badge: count, calls: () => false },
      {
        name: "Notes",
        panels: [reading],
        badge: () => (news() > 0 ? `${news()}` : ""),
        calls: () => news() > 0,
      },
    ]);
  }
}

/** In a tab of its own: this one goes on. */
function openRecordings(): void {
  const { token } = readFragment(location.hash);
  window.open(`./recordings${replayHash({ token: token ?? "", recording: null, event: null })}`, "_blank");
}

/** Makes it when it is first wanted. */
function once<Made>(make: () => Made): () => Made {
  let made: { readonly value: Made } | null = null;
  return () => (made ??= { value: make() }).value;
}
