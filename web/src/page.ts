import type { ChartsDrawer } from "./charts/charts_drawer";
import { ConsoleApp, type ConsoleAppEvents } from "./console_app";
import { holdsSeat, isOperator, note } from "./core/console_state";
import type { PageAction } from "./core/page_keys";
import { staleAge } from "./core/freshness";
import { readFragment } from "./core/fragment";
import { replayHash } from "./core/replay_link";
import { countUnread, createUnread, markRead } from "./core/unread";
import { FIELDS } from "./input/keyboard";
import type { Pad } from "./input/pad";
import { TouchSticks } from "./input/touch_sticks";
import { watchPageKeys } from "./page_keys";
import type { ConsoleApi } from "./rtc/console_api";
import type { SessionApi } from "./rtc/session_api";
import type { FirstOpening } from "./rtc/first_opening";
import type { PeerOptions } from "./rtc/peer";
import { createAnnouncer } from "./ui/announcer";
import { createAlarmStrip } from "./ui/alarm_strip";
import { createArmPanel } from "./ui/arm_panel";
import { createAxisPanel } from "./ui/axis_panel";
import { createBanner } from "./ui/banner";
import { h, setData, type Panel } from "./ui/dom";
import { createEventPanel } from "./ui/event_panel";
import { Later, type LaterParts } from "./ui/later";
import { createLimitsStrip } from "./ui/limits_strip";
import { createOverlay, overlayWords } from "./ui/overlay";
import { createPageTools } from "./ui/page_tools";
import { createSeatBar } from "./ui/seat_bar";
import { Sheets, type SheetContent } from "./ui/sheet";
import { createStatusBar } from "./ui/status_bar";
import { createStopPanel } from "./ui/stop_panel";
import { Tabs, type Tab } from "./ui/tabs";
import { watchTouch } from "./ui/touch_mark";
import { ViewBoard } from "./ui/view_board";
import type { VoiceDesk } from "./voice_desk";

const REDRAW_MS = 66;
const PICTURE_LIMIT_MS = 4000; // then the rest of the page is loaded without a picture
const NOT_LOADED = "Part of this page could not be loaded. Reload the page when the console answers again.";
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
  private charts: ChartsDrawer | null = null; // until its code is there
  private readonly later = new Later(() => note(this.app.state, "error", NOT_LOADED, Date.now()));
  private startedMs = Infinity;
  private readonly panels: Panel[];
  private drawnMs = 0;

  /** `first`: the connection that the page's first script has begun. */
  constructor(api: ConsoleApi, options: PeerOptions, name: string | null, first: FirstOpening | null) {
    const left = h("div", "stick left", { role: "group", "aria-label": "Left stick" });
    const right = h("div", "stick right", { role: "group", "aria-label": "Right stick" });
    this.board = new ViewBoard();
    const events: ConsoleAppEvents = {
      canvas: (info) => this.board.canvas(info),
      mainStream: () => this.board.mainStream(),
      isOccupied: () => this.isOccupied(),
      armedChanged: () => this.draw(performance.now()),
      feedbackTaken: (now) => this.board.update(this.app, now),
      pictureDrawn: () => this.board.scene?.settle(),
    };
    this.app = new ConsoleApp(api, options, name, new TouchSticks(left, right), events, first);
    this.panels = this.build(left, right, api);
    this.later.use((parts) => this.takePad(parts));
    this.later.use(({ Rumble, ContactTone, SceneSwitch, createScene }) => {
      this.board.takeScene(createScene(this.app, this.board, api), new SceneSwitch());
      this.app.touch.rumble = new Rumble();
      this.app.touch.tone = new ContactTone(this.app.audio);
    });
    watchTouch();
  }

  /** Shows the page and keeps it current. */
  start(): void {
    document.body.replaceChildren(this.root);
    this.startedMs = performance.now();
    const frame = (now: number): void => {
      requestAnimationFrame(frame);
      if (now - this.drawnMs >= REDRAW_MS) this.draw(now);
    };
    requestAnimationFrame(frame);
    this.draw(performance.now());
  }

  private build(left: HTMLElement, right: HTMLElement, api: ConsoleApi): Panel[] {
    const { app, board, later } = this;
    const sessionApi = once((parts: LaterParts) => new parts.SessionApi(api));
    const bar = createStatusBar(
      app,
      () => this.root.classList.toggle("shows-details"),
      () => this.countNews(),
    );
    const alarm = createAlarmStrip(app);
    const banner = createBanner(app);
    const event = createEventPanel(app);
    board.card = event.element;
    const force = later.panel((parts) => parts.createForceGauge(app, false));
    const contact = later.panel((parts) => parts.createForceGauge(app, true));
    const radar = later.panel((parts) => parts.createRangeRadar(app));
    const places = later.panel((parts) => parts.createPlacePanel(app));
    const overlay = createOverlay(app);
    const limits = createLimitsStrip(app);
    const scale = later.panel((parts) => parts.createScaleBar(app, () => board.largeStream()));
    const talk = later.panel((parts) => parts.createTalkButton(app, this.takeVoice(parts)));
    const seat = createSeatBar(app, talk);
    const tools = createPageTools({
      charts: () => this.act("charts"),
      keys: () => this.act("keys"),
      pads: () => this.act("pads"),
      scene: () => {
        board.sceneSwitch?.toggle();
        this.draw(performance.now());
      },
    });
    const record = later.panel((parts) => parts.createRecordButton(app, sessionApi(parts)));
    bar.element.append(record.element, tools.bar);
    const status = [
      { element: tools.details, update: () => undefined },
      later.panel((parts) => parts.createStreamTable(app)),
      later.panel((parts) => parts.createDelayPanel(app, () => board.mainStream())),
      later.panel((parts) => parts.createSettingsPanel(app)),
      later.panel((parts) => parts.createLogPanel(app)),
    ];
    const tabs = new Tabs("Session", this.createTabs(status, sessionApi));
    const charts = later.panel((parts) => (this.charts = this.createCharts(parts)));
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
      ...[charts.element, this.sheets.element, deck, announcer.element],
    );
    addEventListener("keydown", (event) => {
      if (event.code === "Escape") this.sheets.close();
    });
    watchPageKeys(app, (action) => this.act(action));
    return [
      bar,
      { element: tools.bar, update: () => tools.update(app, board.sceneSwitch?.isOn === true) },
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

  private takePad(parts: LaterParts): Pad {
    const { controls } = this.app;
    return (controls.pad ??= new parts.Pad(controls.events, new parts.PadStorage()));
  }

  private takeVoice(parts: LaterParts): VoiceDesk {
    const { app } = this;
    app.voice = new parts.VoiceDesk(app);
    app.voice.attach(app.peer?.voiceSender(app.state.welcome?.voice ?? "") ?? null);
    return app.voice;
  }

  private createCharts(parts: LaterParts): ChartsDrawer {
    const toggled = (open: boolean): unknown => this.root.classList.toggle("shows-charts", open);
    this.app.charts = new parts.ChartSampler(this.app);
    return new parts.ChartsDrawer(this.app.charts, toggled);
  }

  private act(action: PageAction): void {
    if (action === "keys") this.openSheet(this.keys);
    else if (action === "pads") this.openSheet(this.pads);
    else if (!this.sheets.isOpen) this.withCharts(action);
  }

  private withCharts(action: Exclude<PageAction, "keys" | "pads">): void {
    this.later.load(performance.now());
    this.later.use(() => {
      if (action === "charts") this.charts?.toggle();
      else if (action === "freeze") this.charts?.freeze();
      else void this.charts?.save();
    });
  }

  private openSheet(create: (parts: LaterParts) => SheetContent): void {
    this.later.load(performance.now());
    this.later.use((parts) => this.sheets.open(create(parts)));
  }

  private readonly keys = once((parts: LaterParts) => parts.createKeysSheet(this.app));
  private readonly pads = once((parts: LaterParts) => parts.createPadSheet(this.takePad(parts)));

  private createTabs(status: readonly Panel[], sessionApi: (parts: LaterParts) => SessionApi): Tab[] {
    const { app, unread, later } = this;
    const inviting = once((parts: LaterParts) => parts.createInviteSheet(app, sessionApi(parts)));
    const auditing = once((parts: LaterParts) => parts.createAuditSheet(sessionApi(parts)));
    const people = later.panel((parts) =>
      parts.createPeoplePanel(app, {
        invite: () => this.openSheet(inviting),
        audit: () => this.openSheet(auditing),
        recordings: openRecordings,
      }),
    );
    const news = (): number => this.countNews();
    const reading = later.panel((parts) => {
      const notes = parts.createNotesPanel(app);
      const read = (now: number): void => {
        notes.update(now);
        if (!document.hidden && notes.element.checkVisibility()) markRead(unread, app.state.notes);
      };
      return { element: notes.element, update: read };
    });
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
    const covers = this.root.classList.contains("shows-details") || this.charts?.isOpen === true;
    return writes || (covers && SMALL_SCREEN.matches) || this.sheets.isOpen;
  }

  /** Who drives gets the controls; a supervisor while holding the seat. */
  private drives(): boolean {
    return isOperator(this.app.state) || holdsSeat(this.app.state);
  }

  /** Whether there is nothing that the rest of the page could keep from coming. */
  private waitsForNoPicture(now: number): boolean {
    const { kind } = this.app.link;
    return (kind !== "connecting" && kind !== "connected") || now - this.startedMs > PICTURE_LIMIT_MS;
  }

  private draw(now: number): void {
    this.drawnMs = now;
    const { app, root } = this;
    if (app.firstPictureMs !== null || this.waitsForNoPicture(now)) this.later.load(now);
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

/** Makes it when it is first wanted. */
function once<Given, Made>(make: (given: Given) => Made): (given: Given) => Made {
  let made: { readonly value: Made } | null = null;
  return (given) => (made ??= { value: make(given) }).value;
}
