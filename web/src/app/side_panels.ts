import { ChartSampler } from "../charts/chart_sampler";
import { ChartsDrawer } from "../charts/charts_drawer";
import type { WaySource } from "../charts/way_figures";
import type { ConsoleEngine } from "../engine/console_engine";
import { Tracing } from "../engine/tracing";
import { MapSwitch } from "../map/map_switch";
import { HeadsetEntry } from "../headset/headset_entry";
import { PictureTrace } from "../media/picture_trace";
import { readFragment } from "../util/url_fragment";
import type { PageAction } from "../input/shortcuts";
import { replayHash } from "../replay/replay_link";
import { holdsSeat, mayDrive } from "../session/console_state";
import { countUnread, createUnread, markRead } from "../session/unread_notes";
import { ForceFeedbackLoader } from "../haptics/force_feedback_loader";
import { Pad } from "../input/gamepad";
import { GamepadStorage } from "../input/gamepad_storage";
import { watchPageKeys } from "./shortcut_listener";
import type { ConsoleApi } from "../transport/signalling/console_api";
import { SessionApi } from "../transport/signalling/session_api";
import { RobotLinkApi } from "../transport/signalling/robot_link_api";
import { createAuditSheet } from "../ui/session/audit/audit_sheet";
import { createDelayPanel } from "../ui/status/delay_panel";
import type { Panel } from "../ui/elements/dom";
import { createInviteSheet } from "../ui/session/invite_sheet";
import { createKeysSheet } from "../ui/driving/keys_sheet";
import { createLogPanel } from "../ui/status/log_panel";
import { createNotesPanel } from "../ui/session/notes_panel";
import { createGamepadSheet } from "../ui/gamepad/gamepad_sheet";
import { createPageTools, type PageTools } from "../ui/status/page_tools";
import { createParticipantsPanel } from "../ui/session/participants_panel";
import { createRobotLinkSheet } from "../ui/session/robot_link_sheet";
import { createRecordButton } from "../ui/session/record_button";
import { createSettingsPanel } from "../ui/driving/settings_panel";
import { Sheets, type SheetContent } from "../ui/elements/sheet";
import { createStreamTable } from "../ui/status/stream_table";
import { Tabs } from "../ui/elements/tabs";
import type { ViewGrid } from "../ui/views/view_grid";

/** What a dialogue makes inert. The control seat, the banner and STOP stay in reach. */
const BEHIND_SHEETS = ".bar, .views, .rail, .arm, .axis-panel, .stick";

/** What stands beside the pictures and needs none: tabs, dialogues, charts, their buttons and keys. */
export class SidePanels {
  readonly record: Panel;
  readonly tools: Panel;
  readonly tabs: Tabs;
  readonly charts: ChartsDrawer;
  readonly sheets: Sheets;
  private readonly unread = createUnread();
  private readonly headset: HeadsetEntry;
  private readonly pageTools: PageTools;
  private readonly map: MapSwitch;
  private readonly session: SessionApi;
  private readonly keys = once(() => createKeysSheet(this.engine));
  private readonly pads: () => SheetContent;
  private readonly inviting = once(() => createInviteSheet(this.engine, this.session));
  private readonly pairing: () => SheetContent;
  private mayPair = false;
  private readonly auditing = once(() => createAuditSheet(this.session));

  /** `redraw`: at once, after something was pressed. */
  constructor(
    private readonly engine: ConsoleEngine,
    private readonly grid: ViewGrid,
    root: HTMLElement,
    api: ConsoleApi,
    private readonly redraw: () => void,
  ) {
    const { controls } = engine;
    const pad = (controls.pad ??= new Pad(controls.events, new GamepadStorage()));
    const forces = new ForceFeedbackLoader(engine);
    this.pads = once(() => createGamepadSheet(pad, forces, engine.display));
    this.session = new SessionApi(api);
    const robotLink = new RobotLinkApi(api);
    this.pairing = once(() => createRobotLinkSheet([["", robotLink]]));
    void this.lookForPairing(robotLink);
    this.sheets = new Sheets(() => root.querySelectorAll<HTMLElement>(BEHIND_SHEETS));
    this.record = createRecordButton(engine, this.session);
    this.headset = new HeadsetEntry({ engine, grid });
    this.map = new MapSwitch(engine, grid, api, redraw);
    this.pageTools = createPageTools({
      charts: () => this.act("charts"),
      keys: () => this.act("keys"),
      pads: () => this.act("pads"),
      scene: () => this.toggleScene(),
      map: () => {
        root.classList.remove("shows-details"); // they would cover it on a small screen
        this.map.toggle();
      },
      headset: (className) => this.headset.createButtons(className),
    });
    this.tools = {
      element: this.pageTools.bar,
      update: (now) => {
        this.map.update(now);
        this.pageTools.update(engine, grid.sceneSwitch?.isOn === true, this.map.isOn);
      },
    };
    this.tabs = this.createTabs();
    const sampler = new ChartSampler(engine);
    engine.charts = sampler;
    const tracing = new Tracing({
      tell: (channel, message) => engine.connection.tell(channel, message),
      isConnected: () => engine.state.welcome !== null,
      drivesRecorded: () => engine.state.recording?.state === "recording" && holdsSeat(engine.state),
      mainStream: () => grid.mainStream(),
    });
    engine.tracing = tracing;
    engine.late.take["traces"] = (message): void => {
      if (message.type === "traces") tracing.book.noteTold(message);
    };
    engine.streams.traceBy(() => new PictureTrace());
    const ways: WaySource = {
      book: tracing.book,
      mainStream: () => grid.mainStream(),
      mayDrive: () => mayDrive(engine.state),
      isRelayed: () => engine.streams.relay !== null,
    };
    this.charts = new ChartsDrawer(sampler, ways, (open) => {
      tracing.show(open, performance.now());
      root.classList.toggle("shows-charts", open);
    });
    addEventListener("keydown", (event) => {
      if (event.code === "Escape") this.sheets.close();
    });
    watchPageKeys(engine, (action) => this.act(action));
  }

  countNews(): number {
    const { notes, welcome } = this.engine.state;
    return countUnread(this.unread, notes, welcome?.peer ?? null);
  }

  private act(action: PageAction): void {
    if (action === "keys") this.sheets.open(this.keys());
    else if (action === "pads") this.sheets.open(this.pads());
    else if (this.sheets.isOpen) return;
    else if (action === "charts") this.charts.toggle();
    else if (action === "frames") this.engine.streams.overlay?.toggle();
    else if (action === "freeze") this.charts.freeze();
    else void this.charts.save();
  }

  /** A supervisor of a robot that dials in may pair it; while none is paired there is nothing else to do. */
  private async lookForPairing(api: RobotLinkApi): Promise<void> {
    try {
      const link = await api.state();
      this.mayPair = link.mayPair;
      if (link.mayPair && link.state === "unpaired" && !this.sheets.isOpen) this.sheets.open(this.pairing());
    } catch {
      this.mayPair = false; // the page says itself that the console does not answer
    }
  }

  private toggleScene(): void {
    this.grid.sceneSwitch?.toggle();
    this.redraw();
  }

  private createTabs(): Tabs {
    const { engine } = this;
    const status = [
      { element: this.pageTools.details, update: () => undefined },
      createStreamTable(engine),
      createDelayPanel(engine, () => this.grid.mainStream()),
      createSettingsPanel(engine),
      this.headset.createSettings(),
      createLogPanel(engine),
    ];
    const people = createParticipantsPanel(engine, {
      invite: () => this.sheets.open(this.inviting()),
      audit: () => this.sheets.open(this.auditing()),
      recordings: () => openBeside("recordings"),
      episodes: () => openBeside("episodes"),
      robotLink: () => (this.mayPair ? () => this.sheets.open(this.pairing()) : null),
    });
    const notes = createNotesPanel(engine);
    const reading: Panel = {
      element: notes.element,
      update: (now) => {
        notes.update(now);
        if (engine.display.visible && notes.element.checkVisibility())
          markRead(this.unread, engine.state.notes);
      },
    };
    const news = (): number => this.countNews();
    const count = (): string =>
      engine.state.participants.length > 0 ? `${engine.state.participants.length}` : "";
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
function openBeside(page: "recordings" | "episodes"): void {
  const { token } = readFragment(location.hash);
  window.open(`./${page}${replayHash({ token: token ?? "", recording: null, event: null })}`, "_blank");
}

/** Makes it when it is first wanted. */
function once<Made>(make: () => Made): () => Made {
  let made: { readonly value: Made } | null = null;
  return () => (made ??= { value: make() }).value;
}
