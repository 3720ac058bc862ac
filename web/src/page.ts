import { ConsoleApp, type ConsoleAppEvents } from "./console_app";
import { holdsSeat, isOperator, note } from "./core/console_state";
import { staleAge } from "./core/freshness";
import { FIELDS } from "./input/keyboard";
import type { PageSide } from "./page_side";
import { TouchSticks } from "./input/touch_sticks";
import type { ConsoleApi } from "./rtc/console_api";
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
import { createSeatBar } from "./ui/seat_bar";
import { createStatusBar } from "./ui/status_bar";
import { createStopPanel } from "./ui/stop_panel";
import { watchTouch } from "./ui/touch_mark";
import { ViewBoard } from "./ui/view_board";
import type { VoiceDesk } from "./voice_desk";

const REDRAW_MS = 66;
const PICTURE_LIMIT_MS = 4000; // then the rest of the page is loaded without a picture
const NOT_LOADED = "Part of this page could not be loaded. Reload the page when the console answers again.";
const SMALL_SCREEN = matchMedia("(max-width: 999px)");

/** The whole page: one engine, and panels that show it. */
export class Page {
  readonly app: ConsoleApp;
  readonly board: ViewBoard;
  private readonly root = h("div", "console");
  private side: PageSide | null = null; // until its code is there
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
    this.later.use(({ installHook }) => installHook(this));
    this.later.use(({ Rumble, ContactTone, SceneSwitch, SoundStream, createScene }) => {
      this.app.room.sound = SoundStream;
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
    const redraw = (): void => this.draw(performance.now());
    const side = (parts: LaterParts): PageSide =>
      (this.side ??= new parts.PageSide(app, board, this.root, api, redraw));
    const bar = createStatusBar(
      app,
      () => this.root.classList.toggle("shows-details"),
      () => this.side?.countNews() ?? 0,
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
    const record = later.panel((parts) => side(parts).record);
    const tools = later.panel((parts) => side(parts).tools);
    bar.element.append(record.element, tools.element);
    const tabs = later.panel((parts) => side(parts).tabs);
    const charts = later.panel((parts) => side(parts).charts);
    const sheets = later.panel((parts) => ({ element: side(parts).sheets.element, update: () => undefined }));
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
      ...[charts.element, sheets.element, deck, announcer.element],
    );
    return [
      bar,
      tools,
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

  private takeVoice(parts: LaterParts): VoiceDesk {
    const { app } = this;
    app.voice = new parts.VoiceDesk(app);
    app.voice.attach(app.peer?.voiceSender(app.state.welcome?.voice ?? "") ?? null);
    return app.voice;
  }

  /** Whether keys write, or something stands over the pictures. */
  private isOccupied(): boolean {
    const writes = document.activeElement?.matches(FIELDS) ?? false;
    const covers = this.root.classList.contains("shows-details") || this.side?.charts.isOpen === true;
    return writes || (covers && SMALL_SCREEN.matches) || this.side?.sheets.isOpen === true;
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
