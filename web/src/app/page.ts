import { ConsoleEngine, type ConsoleEngineEvents } from "../engine/console_engine";
import { holdsSeat, isOperator, note } from "../session/console_state";
import { feedbackAge } from "../drive/feedback_age";
import { FIELDS } from "../input/keyboard";
import type { SidePanels } from "./side_panels";
import { TouchSticks } from "../input/touch_sticks";
import type { ConsoleApi } from "../transport/signalling/console_api";
import type { Preconnection } from "../transport/webrtc/preconnection";
import type { PeerOptions } from "../transport/peer";
import { createAlarmStrip } from "../ui/status/alarm_strip";
import { createArmPanel } from "../ui/driving/arm_panel";
import { createAxisPanel } from "../ui/driving/axis_panel";
import { createBanner } from "../ui/status/banner";
import { h, setData, type Panel } from "../ui/elements/dom";
import { createEventPanel } from "../ui/driving/event_panel";
import { DeferredLoader, type DeferredParts } from "./deferred_loader";
import { createOverlay, overlayLabels } from "../ui/views/overlay";
import { createSeatBar } from "../ui/session/seat_bar";
import { createStatusBar } from "../ui/status/status_bar";
import type { RobotStrip } from "../ui/robot/robot_strip";
import { takeResetWords } from "../stop/reset_labels";
import { createStopPanel } from "../ui/driving/stop_panel";
import { watchTouch } from "../ui/elements/touch_detection";
import { ViewGrid } from "../ui/views/view_grid";
import type { Talkback } from "../talkback/talkback";

const REDRAW_MS = 66;
const PICTURE_LIMIT_MS = 4000; // then the rest of the page is loaded without a picture
const NOT_LOADED = "Part of this page could not be loaded. Reload the page when the console answers again.";
const SMALL_SCREEN = matchMedia("(max-width: 999px)");

/** The whole page: one engine, and panels that show it. */
export class Page {
  readonly engine: ConsoleEngine;
  readonly grid: ViewGrid;
  private readonly root = h("div", "console");
  private side: SidePanels | null = null; // until its code is there
  private readonly later = new DeferredLoader(() => note(this.engine.state, "error", NOT_LOADED, Date.now()));
  private startedMs = Infinity;
  private robot: RobotStrip | null = null; // until its code is there
  private readonly panels: Panel[];
  private drawnMs = 0;

  /** `first`: the connection that the page's first script has begun. */
  constructor(api: ConsoleApi, options: PeerOptions, name: string | null, first: Preconnection | null) {
    const left = h("div", "stick left", { role: "group", "aria-label": "Left stick" });
    const right = h("div", "stick right", { role: "group", "aria-label": "Right stick" });
    this.grid = new ViewGrid();
    const events: ConsoleEngineEvents = {
      canvas: (info) => this.grid.canvas(info),
      mainStream: () => this.grid.mainStream(),
      isOccupied: () => this.isOccupied(),
      armedChanged: () => this.draw(performance.now()),
      actionPressed: (index) => this.robot?.press(index),
      feedbackTaken: (now) => {
        const { feedback } = this.engine.state;
        if (feedback !== null) this.engine.streams.overlay?.take(feedback);
        this.grid.update(this.engine, now);
      },
      pictureDrawn: () => this.grid.scene?.settle(),
    };
    this.engine = new ConsoleEngine(api, options, name, new TouchSticks(left, right), events, first);
    this.later.use(({ lateMisfit }) => this.engine.late.read(lateMisfit)); // before there are panels that take messages
    this.later.use(({ createHaptics }) => (this.engine.haptics = createHaptics(this.engine))); // and that show forces
    this.panels = this.build(left, right, api);
    this.later.use(({ installHook }) => installHook(this));
    this.later.use(({ RESET_WORDS }) => takeResetWords(RESET_WORDS));
    this.later.use(({ watchPictureClicks }) => watchPictureClicks(this.engine, this.grid.element));
    this.later.use(({ ToolOverlay }) => {
      this.engine.streams.overlay = new ToolOverlay(() => this.engine.state.robot?.description ?? null);
    });
    this.later.use(({ SceneSwitch, SoundStream, createScene }) => {
      this.engine.streams.sound = SoundStream;
      this.grid.takeScene(createScene(this.engine, this.grid, api), new SceneSwitch());
    });
    watchTouch();
  }

  /** Shows the page and keeps it current. */
  start(): void {
    document.body.replaceChildren(this.root);
    this.startedMs = performance.now();
    const { display } = this.engine;
    const frame = (now: number): void => {
      display.request(frame);
      if (now - this.drawnMs >= REDRAW_MS) this.draw(now);
    };
    display.request(frame);
    this.draw(performance.now());
  }

  private build(left: HTMLElement, right: HTMLElement, api: ConsoleApi): Panel[] {
    const { engine, grid: grid, later } = this;
    const redraw = (): void => this.draw(performance.now());
    const side = (parts: DeferredParts): SidePanels =>
      (this.side ??= new parts.SidePanels(engine, grid, this.root, api, redraw));
    const bar = createStatusBar(
      engine,
      () => this.root.classList.toggle("shows-details"),
      () => this.side?.countNews() ?? 0,
    );
    const alarm = createAlarmStrip(engine);
    const banner = createBanner(engine);
    const robot = later.panel((parts) => {
      engine.actions = new parts.ActionClient(
        (message) => engine.connection.tell("session", message),
        parts.drawId,
      );
      return (this.robot = parts.createRobotStrip(engine));
    });
    const episodes = later.panel((parts) => parts.createEpisodeBar(engine));
    const policies = later.panel((parts) => parts.createPolicyBar(engine));
    const event = createEventPanel(engine);
    grid.cardPlace.card = event.element;
    const force = later.panel((parts) => parts.createForceGauge(engine, false));
    const contact = later.panel((parts) => parts.createForceGauge(engine, true));
    const radar = later.panel((parts) => parts.createRangeRadar(engine));
    const places = later.panel((parts) => parts.createAxisPositionPanel(engine));
    const overlay = createOverlay(engine);
    const limits = later.panel((parts) => parts.createLimitsStrip(engine));
    const scale = later.panel((parts) => parts.createScaleBar(engine, () => grid.largeStream()));
    const talk = later.panel((parts) => parts.createTalkButton(engine, this.takeVoice(parts)));
    const seat = createSeatBar(engine, talk);
    const record = later.panel((parts) => side(parts).record);
    const tools = later.panel((parts) => side(parts).tools);
    bar.element.append(record.element, tools.element);
    const tabs = later.panel((parts) => side(parts).tabs);
    const charts = later.panel((parts) => side(parts).charts);
    const sheets = later.panel((parts) => ({ element: side(parts).sheets.element, update: () => undefined }));
    const arm = createArmPanel(engine);
    const axes = createAxisPanel(
      engine,
      later.panel((parts) => parts.createAxisBars(engine)),
    );
    const stop = createStopPanel(engine);
    // Screen readers tell only what changes in a region that was there before.
    const polite = h("div", "unseen", { "aria-live": "polite" });
    const urgent = h("div", "unseen", { "aria-live": "assertive" });
    const announcer = later.panel((parts) => parts.createAnnouncer(engine, polite, urgent));
    grid.gauges.append(places.element, force.element, radar.element);
    grid.element.append(
      h("div", "stage", {}, scale.element, contact.element, limits.element, overlay.element),
    );
    const rail = h("aside", "rail", {}, event.element, robot.element, tabs.element);
    const deck = h("footer", "deck", {}, arm.element, axes.element, left, right, stop.element);
    this.root.append(
      ...[bar.element, seat.element],
      h("div", "strips", {}, alarm.element, banner.element, policies.element, episodes.element),
      ...[grid.element, rail],
      ...[charts.element, sheets.element, deck, polite, urgent],
    );
    return [
      bar,
      tools,
      record,
      seat,
      alarm,
      banner,
      robot,
      policies,
      episodes,
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

  private takeVoice(parts: DeferredParts): Talkback {
    const { engine } = this;
    engine.talkback = new parts.Talkback(engine);
    engine.talkback.attach(engine.peer?.voiceSender(engine.state.welcome?.voice ?? "") ?? null);
    return engine.talkback;
  }

  /** Whether keys write, or something stands over the pictures. */
  private isOccupied(): boolean {
    const writes = document.activeElement?.matches(FIELDS) ?? false;
    const covers = this.root.classList.contains("shows-details") || this.side?.charts.isOpen === true;
    return writes || (covers && SMALL_SCREEN.matches) || this.side?.sheets.isOpen === true;
  }

  /** Who drives gets the controls; a supervisor while holding the seat. */
  private drives(): boolean {
    return isOperator(this.engine.state) || holdsSeat(this.engine.state);
  }

  /** Whether there is nothing that the rest of the page could keep from coming. */
  private waitsForNoPicture(now: number): boolean {
    const { kind } = this.engine.connectionState;
    return (kind !== "connecting" && kind !== "connected") || now - this.startedMs > PICTURE_LIMIT_MS;
  }

  private draw(now: number): void {
    this.drawnMs = now;
    const { engine, root } = this;
    if (engine.firstPictureMs !== null || this.waitsForNoPicture(now)) this.later.load(now);
    setData(root, "armed", engine.driving.arming.state);
    setData(root, "role", engine.state.welcome === null ? "" : this.drives() ? "operator" : "observer");
    setData(root, "link", engine.connectionState.kind);
    setData(root, "stale", String(feedbackAge(engine.measuredMs, now) !== null));
    setData(root, "stopped", String(engine.state.stop.stopped));
    setData(root, "gate", engine.state.settings.gate === "event" ? "on" : "off");
    root.classList.toggle("has-overlay", overlayLabels(engine, now) !== null);
    this.grid.update(engine, now);
    for (const panel of this.panels) panel.update(now);
  }
}
