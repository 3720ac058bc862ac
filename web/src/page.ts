import { ChartsDrawer } from "./charts/charts_drawer";
import { ConsoleApp } from "./console_app";
import { holdsSeat, isOperator } from "./core/console_state";
import type { PageAction } from "./core/page_keys";
import { staleAge } from "./core/freshness";
import { readFragment } from "./core/fragment";
import { replayHash } from "./core/replay_link";
import { sceneDue } from "./core/scene_gate";
import { countUnread, createUnread, markRead } from "./core/unread";
import { FIELDS } from "./input/keyboard";
import { TouchSticks } from "./input/touch_sticks";
import { watchPageKeys } from "./page_keys";
import type { ConsoleApi } from "./rtc/console_api";
import type { PeerOptions } from "./rtc/peer";
import { SessionApi } from "./rtc/session_api";
import { createAnnouncer } from "./ui/announcer";
import { createAlarmStrip } from "./ui/alarm_strip";
import { createArmPanel } from "./ui/arm_panel";
import { createAuditSheet } from "./ui/audit_sheet";
import { createAxisPanel } from "./ui/axis_panel";
import { createBanner } from "./ui/banner";
import { createDelayPanel } from "./ui/delay_panel";
import { h, setData, type Panel } from "./ui/dom";
import { createEventPanel } from "./ui/event_panel";
import { createForceGauge } from "./ui/force_gauge";
import { createInviteSheet } from "./ui/invite_sheet";
import { createKeysSheet } from "./ui/keys_sheet";
import { createLimitsStrip } from "./ui/limits_strip";
import { createLogPanel } from "./ui/log_panel";
import { createNotesPanel } from "./ui/notes_panel";
import { createPadSheet } from "./ui/pad_sheet";
import { createOverlay, overlayWords } from "./ui/overlay";
import { createPageTools } from "./ui/page_tools";
import { createPeoplePanel } from "./ui/people_panel";
import { createPlacePanel } from "./ui/place_panel";
import { createRangeRadar } from "./ui/range_radar";
import { createRecordButton } from "./ui/record_button";
import { createScaleBar } from "./ui/scale_bar";
import { SceneView } from "./ui/scene_view";
import { createSeatBar } from "./ui/seat_bar";
import { createSettingsPanel } from "./ui/settings_panel";
import { Sheets, type SheetContent } from "./ui/sheet";
import { createStatusBar } from "./ui/status_bar";
import { createStopPanel } from "./ui/stop_panel";
import { createStreamTable } from "./ui/stream_table";
import { Tabs, type Tab } from "./ui/tabs";
import { watchTouch } from "./ui/touch_mark";
import { ViewBoard } from "./ui/view_board";

const REDRAW_MS = 66;
/** What a dialogue makes inert. The control seat, the banner and STOP stay in reach. */
const BEHIND_SHEETS = ".bar, .views, .rail, .arm, .axis-panel, .stick";

const SMALL_SCREEN = matchMedia("(max-width: 999px)");

/** The whole page: one engine, and panels that show it. */
export class Page {
  readonly app: ConsoleApp;
  readonly board: ViewBoard;
  private readonly root = h("div", "console");
  private readonly sheets = new Sheets(() => this.root.querySelectorAll<HTMLElement>(BEHIND_SHEETS));
  private readonly unread = createUnread();
  private readonly charts: ChartsDrawer;
  private readonly keys: SheetContent;
  private readonly pads: SheetContent;
  private readonly panels: Panel[];
  private drawnMs = 0;

  constructor(api: ConsoleApi, options: PeerOptions, name: string | null) {
    const left = h("div", "stick left", { role: "group", "aria-label": "Left stick" });
    const right = h("div", "stick right", { role: "group", "aria-label": "Right stick" });
    this.board = new ViewBoard(this.scene(api));
    this.app = new ConsoleApp(api, options, name, new TouchSticks(left, right), {
      canvas: (info) => this.board.canvas(info),
      mainStream: () => this.board.mainStream(),
      isOccupied: () => this.isOccupied(),
      armedChanged: () => this.draw(performance.now()),
      feedbackTaken: (now) => this.board.update(this.app, now),
      pictureDrawn: () => this.board.scene.settle(),
    });
    this.keys = createKeysSheet(this.app);
    this.pads = createPadSheet(this.app.controls.pad);
    this.charts = new ChartsDrawer(this.app.charts, (open) =>
      this.root.classList.toggle("shows-charts", open),
    );
    this.panels = this.build(left, right, new SessionApi(api));
    watchTouch();
  }

  private scene(api: ConsoleApi): SceneView {
    return new SceneView(api, {
      due: () => {
        const video = this.app.room.videos.get(this.board.mainStream() ?? "");
        return sceneDue(this.app.room.context("video"), video?.gate.shown ?? null);
      },
      context: () => this.app.room.context("video"),
      onkey: (key) => this.app.controls.keyboard.foreign(key),
    });
  }

  /** Shows the page and keeps it current. */
  start(): void {
    document.body.replaceChildren(this.root);
    const frame = (now: number): void => {
      requestAnimationFrame(frame);
      if (now - this.drawnMs >= REDRAW_MS) this.draw(now);
    };
    requestAnimationFrame(frame);
    this.draw(performance.now());
  }

  private build(left: HTMLElement, right: HTMLElement, sessionApi: SessionApi): Panel[] {
    const { app, board } = this;
    const bar = createStatusBar(
      app,
      () => this.root.classList.toggle("shows-details"),
      () => this.countNews(),
    );
    const alarm = createAlarmStrip(app);
    const banner = createBanner(app);
    const event = createEventPanel(app);
    const force = createForceGauge(app, false);
    const contact = createForceGauge(app, true);
    const radar = createRangeRadar(app);
    const places = createPlacePanel(app);
    const overlay = createOverlay(app);
    const limits = createLimitsStrip(app);
    const scale = createScaleBar(app, () => board.largeStream());
    const seat = createSeatBar(app);
    const tools = createPageTools({
      charts: () => this.act("charts"),
      keys: () => this.act("keys"),
      pads: () => this.act("pads"),
      scene: () => {
        board.sceneSwitch.toggle();
        this.draw(performance.now());
      },
    });
    const record = createRecordButton(app, sessionApi);
    bar.element.append(record.element, tools.bar);
    const status = [
      { element: tools.details, update: () => undefined },
      createStreamTable(app),
      createDelayPanel(app, () => board.mainStream()),
      createSettingsPanel(app),
      createLogPanel(app),
    ];
    const tabs = new Tabs("Session", this.createTabs(status, sessionApi));
    const arm = createArmPanel(app);
    const axes = createAxisPanel(app);
    const stop = createStopPanel(app);
    const announcer = createAnnouncer(app);
    board.gauges.append(places.element, force.element, radar.element);
    board.element.append(
      h("div", "stage", {}, scale.element, contact.element, limits.element, overlay.element),
    );
    const rail = h("aside", "rail", {}, event.element, tabs.element);
    const deck = h("footer", "deck", {}, arm.element, axes.element, left, right, stop.element);
    this.root.append(
      ...[bar.element, seat.element],
      h("div", "strips", {}, alarm.element, banner.element),
      ...[board.element, rail],
      ...[this.charts.element, this.sheets.element, deck, announcer.element],
    );
    addEventListener("keydown", (event) => {
      if (event.code === "Escape") this.sheets.close();
    });
    watchPageKeys(app, (action) => this.act(action));
    const { charts } = this;
    return [
      bar,
      { element: tools.bar, update: () => tools.update(app, board.sceneSwitch.isOn) },
      record,
      seat,
      alarm,
      banner,
      event,
      force,
      contact,
      radar,
      places,
      overlay,
      limits,
      scale,
      tabs,
      charts,
      arm,
      axes,
      stop,
      announcer,
    ];
  }

  private act(action: PageAction): void {
    if (action === "keys") this.sheets.open(this.keys);
    else if (action === "pads") this.sheets.open(this.pads);
    else if (this.sheets.isOpen) return;
    else if (action === "charts") this.charts.toggle();
    else if (action === "freeze") this.charts.freeze();
    else void this.charts.save();
  }

  private createTabs(status: readonly Panel[], sessionApi: SessionApi): Tab[] {
    const { app, unread, sheets } = this;
    const inviting = createInviteSheet(app, sessionApi);
    const auditing = createAuditSheet(sessionApi);
    const people = createPeoplePanel(app, {
      invite: () => sheets.open(inviting),
      audit: () => sheets.open(auditing),
      recordings: openRecordings,
    });
    const news = (): number => this.countNews();
    const notes = createNotesPanel(app);
    const reading: Panel = {
      element: notes.element,
      update: (now) => {
        notes.update(now);
        if (!document.hidden && notes.element.checkVisibility()) markRead(unread, app.state.notes);
      },
    };
    const count = (): string => (app.state.participants.length > 0 ? `${app.state.participants.length}` : "");
    return [
      { name: "Status", panels: status, badge: () => "", calls: () => false },
      { name: "People", panels: [people], badge: count, calls: () => false },
      {
        name: "Notes",
        panels: [reading],
        badge: () => (news() > 0 ? `${news()}` : ""),
        calls: () => news() > 0,
      },
    ];
  }

  private countNews(): number {
    const { notes, welcome } = this.app.state;
    return countUnread(this.unread, notes, welcome?.peer ?? null);
  }

  /** Whether keys write, or something stands over the pictures. */
  private isOccupied(): boolean {
    const writes = document.activeElement?.matches(FIELDS) ?? false;
    const covers = this.root.classList.contains("shows-details") || this.charts.isOpen;
    return writes || (covers && SMALL_SCREEN.matches) || this.sheets.isOpen;
  }

  /** Who drives gets the controls; a supervisor while holding the seat. */
  private drives(): boolean {
    return isOperator(this.app.state) || holdsSeat(this.app.state);
  }

  private draw(now: number): void {
    this.drawnMs = now;
    const { app, root } = this;
    setData(root, "armed", app.arming.state);
    setData(root, "role", app.state.welcome === null ? "" : this.drives() ? "operator" : "observer");
    setData(root, "link", app.link.kind);
    setData(root, "stale", String(staleAge(app.measuredMs, now) !== null));
    setData(root, "stopped", String(app.state.stop.stopped));
    setData(root, "gate", app.state.settings.gate === "event" ? "on" : "off");
    root.classList.toggle("has-overlay", overlayWords(app, now) !== null);
    this.board.update(app, now);
    for (const panel of this.panels) panel.update(now);
  }
}

/** In a tab of its own: this one goes on. */
function openRecordings(): void {
  const { token } = readFragment(location.hash);
  window.open(`./recordings${replayHash({ token: token ?? "", recording: null, event: null })}`, "_blank");
}
