import type { FleetRobot } from "../fleet_status";
import { clockLabel, createPollState, pollPhase, tookAnswer, tookError, type PollPhase } from "../poll_state";
import { isFound, robotsLabel, sortFleet, summaryLabel } from "../robot_order";
import type { PageLink } from "../../util/url_fragment";
import { tookStopReplies } from "../stop_all";
import { isTrouble, tileState, type TileState } from "../tile_state";
import { CONNECTION_ERROR_LABELS } from "../../transport/connection_error";
import { Disposal } from "../../input/disposal";
import { isStopKey } from "../../input/keyboard";
import { watchPage } from "../../input/page_lifecycle";
import { ConsoleApi } from "../../transport/signalling/console_api";
import { button, h, setData, setHidden, setText, type Panel } from "../../ui/elements/dom";
import { Sheets } from "../../ui/elements/sheet";
import { DirectStop } from "../direct_stop";
import { createFleetAudit } from "./audit_sheet";
import { createRobotLinkSheet } from "../../ui/session/robot_link_sheet";
import { RobotLinkApi } from "../../transport/signalling/robot_link_api";
import { messageElement, messageOf, NO_LINK } from "./fleet_message";
import { FleetPoll } from "../fleet_poll";
import { StopAllSender } from "../stop_all_sender";
import { createFleetTools } from "./fleet_tools";
import { createStopBar } from "./stop_bar";
import { Thumbnails } from "./thumbnails";
import { Tile } from "./tile";

const STEP_MS = 50;
const REDRAW_MS = 100;
const HOLD_MS = 3000; // tiles stay where they are this long after the pointer moved over them

/** The overview of a fleet: a tile for each robot, STOP for all of them. */
export class FleetPage {
  readonly pollState = createPollState();
  readonly tiles = new Map<string, Tile>();
  shown: readonly Tile[] = []; // in the order of the page
  readonly thumbnails: Thumbnails;
  readonly stopping: StopAllSender;
  private readonly poll: FleetPoll;
  private readonly disposal = new Disposal();
  private readonly summary = h("p", "fleet-summary muted");
  private readonly banner = h("div", "banner", { role: "status" });
  private readonly grid = h("ul", "fleet-grid", { role: "list", "aria-label": "Robots" });
  private readonly place = h("div", "fleet-place");
  private readonly polite = h("div", "unseen", { "aria-live": "polite" });
  private readonly tools = createFleetTools(() => this.arrange(true));
  private readonly sheets = new Sheets(
    () => this.root.querySelectorAll<HTMLElement>(".fleet-bar, .fleet-main"),
    "Esc stops every robot",
  );
  private readonly auditing: HTMLButtonElement; // for supervisors
  private readonly linking: HTMLButtonElement; // for supervisors
  private readonly stopBar: Panel;
  private readonly root = h("div", "fleet");
  private messageKey = "";
  private pointedMs = -Infinity;
  private drawnMs = 0;

  constructor(
    api: ConsoleApi,
    private readonly link: PageLink,
  ) {
    const audit = createFleetAudit(api);
    this.auditing = button("quiet-button fleet-audit", "Audit trail", () => this.sheets.open(audit));
    this.linking = button("quiet-button fleet-audit", "Robot links", () => this.openLinks());
    this.thumbnails = new Thumbnails(link.token ?? "", link);
    const direct = new DirectStop(link.token ?? "", (press, reply) =>
      tookStopReplies(this.stopping.stop, press, [reply]),
    );
    this.stopping = new StopAllSender(api, (reason, press) => {
      this.thumbnails.stop(reason, press);
      direct.say(this.robots, reason, press);
    });
    this.poll = new FleetPoll(api, {
      answer: (answer, askedMs) => {
        tookAnswer(this.pollState, answer, askedMs, performance.now(), Date.now());
        this.stopping.took(answer.robots);
        this.follow();
      },
      trouble: (trouble) => {
        tookError(this.pollState, trouble);
        this.follow();
      },
    });
    this.stopBar = createStopBar(this.stopping.stop, {
      stop: (reason) => this.stop(reason),
      putAway: () => this.stopping.putAway(),
      whom: () => this.whomStopReaches(),
    });
  }

  /** The robots of this console that dial in, or may; those of other consoles have their own pages. */
  private openLinks(): void {
    const own = this.robots.filter((robot) => robot.console === "");
    const api = ({ name }: FleetRobot): RobotLinkApi =>
      new RobotLinkApi(new ConsoleApi(this.link.token ?? "", `./robots/${name}/`));
    this.sheets.open(createRobotLinkSheet(own.map((robot) => [robot.name, api(robot)])));
  }

  get robots(): readonly FleetRobot[] {
    return this.pollState.answer?.robots ?? [];
  }

  phase(now: number): PollPhase {
    return pollPhase(this.pollState, now);
  }

  /** Shows the page and keeps it current. */
  start(): void {
    const title = h("h1", "fleet-title", {}, "Robots");
    const bar = h(
      "header",
      "bar fleet-bar",
      {},
      h("span", "bar-brand", {}, "Lockstep"),
      title,
      this.summary,
      this.linking,
      this.auditing,
      this.tools.element,
    );
    this.place.append(this.grid);
    this.root.append(
      bar,
      this.banner,
      h("main", "fleet-main", {}, this.place),
      this.sheets.element,
      this.stopBar.element,
      this.polite,
    );
    document.body.replaceChildren(this.root);
    this.watch();
    if (this.link.token !== null) void this.poll.run();
    this.draw(performance.now());
  }

  stop(reason: string): void {
    const now = performance.now();
    this.stopping.press(reason, this.robots, now);
    this.draw(now);
  }

  /** A page that may not stop anything says so before somebody relies on it. */
  private whomStopReaches(): string {
    if (this.link.token === null) return "not without a link";
    if (this.phase(performance.now()) === "shut_out") return "your link is not valid";
    return this.robots.length === 0 ? "every robot" : robotsLabel(this.robots.length);
  }

  private watch(): void {
    const { disposal } = this;
    const keys = (event: KeyboardEvent): void => {
      if (!isStopKey(event)) return;
      event.preventDefault();
      if (!event.repeat) this.stop("stop key");
    };
    disposal.listen(window, "keydown", keys, { capture: true });
    this.grid.addEventListener("pointermove", () => (this.pointedMs = performance.now()), { passive: true });
    watchPage(disposal, {
      blurred: () => undefined,
      left: () => this.thumbnails.endAll(),
      visibilityChanged: () => {
        this.step(performance.now());
        if (!document.hidden) this.poll.askNow();
      },
      networkChanged: () => {
        this.thumbnails.alarm();
        this.poll.askNow();
      },
    });
    const timer = setInterval(() => this.step(performance.now()), STEP_MS);
    disposal.add(() => clearInterval(timer));
  }

  private step(now: number): void {
    this.stopping.step(now);
    this.thumbnails.step(this.shown, now);
    if (now - this.drawnMs >= REDRAW_MS) this.draw(now);
  }

  /** The console told, or did not: tiles come, go and change. */
  private follow(): void {
    const told = new Map(this.robots.map((robot) => [robot.name, robot]));
    for (const tile of this.tiles.values())
      if (!told.has(tile.name)) {
        this.thumbnails.forget(tile);
        tile.element.remove();
        this.tiles.delete(tile.name);
        this.shown = this.shown.filter((each) => each !== tile);
      }
    for (const name of told.keys())
      if (!this.tiles.has(name)) {
        const tile = new Tile(name);
        this.tiles.set(name, tile);
        this.thumbnails.watch(tile);
      }
    this.draw(performance.now());
  }

  private draw(now: number): void {
    this.drawnMs = now;
    const phase = this.phase(now);
    setData(this.root, "phase", this.link.token === null ? "shut_out" : phase);
    const unknownSince = phase === "unknown" ? this.pollState.heardAt : null;
    const before = new Map([...this.tiles].map(([name, tile]) => [name, tile.state]));
    for (const robot of this.robots) {
      const tile = this.tiles.get(robot.name);
      tile?.show(robot, tileState(robot, { unknownSince, heardAt: this.pollState.heardAt }));
      tile?.showPicture(now);
    }
    if (phase !== "unknown") this.arrange(false);
    const supervises = this.pollState.answer?.role === "supervisor";
    setHidden(this.auditing, !supervises);
    setHidden(this.linking, !supervises);
    this.announce(before, phase);
    this.showBanner(phase);
    this.showMessage(phase);
    this.stopBar.update(now);
  }

  /** Puts the tiles in order; not under a hand that is about to press, unless somebody asked for it: `atOnce`. */
  private arrange(atOnce: boolean): void {
    const ranked = [...this.tiles.values()].flatMap(({ robot, state }) =>
      robot === null || state === null ? [] : [{ robot, kind: state.kind }],
    );
    const isNew = ranked.some(({ robot }) => this.tiles.get(robot.name)?.element.parentNode !== this.grid);
    const isHeld = performance.now() - this.pointedMs < HOLD_MS || this.grid.contains(document.activeElement);
    if (!atOnce && !isNew && isHeld) return;
    const order = sortFleet(ranked, this.tools.sorting).flatMap((name) => this.tiles.get(name) ?? []);
    for (const [index, tile] of order.entries())
      if (this.grid.children[index] !== tile.element)
        this.grid.insertBefore(tile.element, this.grid.children[index] ?? null);
    for (const tile of order)
      setHidden(tile.element, tile.robot !== null && !isFound(tile.robot, this.tools.query));
    this.shown = order.filter((tile) => !tile.element.hidden);
    setData(this.grid, "few", this.shown.length <= 3 ? `${this.shown.length}` : "");
  }

  /** What a screen reader hears: states that became or ended as trouble. */
  private announce(before: ReadonlyMap<string, TileState | null>, phase: PollPhase): void {
    const kinds = [...this.tiles.values()].flatMap(({ state }) => (state === null ? [] : [state.kind]));
    const hidden = this.tiles.size - this.shown.length;
    const shown = hidden === 0 ? "" : ` · ${hidden} hidden by the filter`;
    setText(this.summary, kinds.length === 0 ? "" : `${summaryLabel(kinds)}${shown}`);
    const troubled = kinds.filter(isTrouble).length;
    const title =
      troubled === 0 || phase !== "live" ? "Robots · Lockstep" : `(${troubled}) Robots · Lockstep`;
    if (document.title !== title) document.title = title;
    if (phase !== "live") return;
    const changes = [...this.tiles.values()].filter(({ name, state }) => {
      const was = before.get(name);
      if (was === undefined || was === null || state === null || was.kind === state.kind) return false;
      return isTrouble(was.kind) || isTrouble(state.kind);
    });
    if (changes.length > 0)
      setText(this.polite, changes.map(({ name, state }) => `${name}: ${state?.words ?? ""}`).join(". "));
  }

  /** What concerns the page as a whole. */
  private showBanner(phase: PollPhase): void {
    const { answer, trouble, heardAt } = this.pollState;
    let words = answer?.notices.map((notice) => notice.text).join(" ") ?? "";
    let tone = answer?.notices.some((notice) => notice.level === "error") === true ? "bad" : "wait";
    const lost = phase === "unknown" || (phase === "loading" && trouble !== null);
    if (lost) {
      const why =
        trouble !== null && "why" in trouble
          ? CONNECTION_ERROR_LABELS[trouble.why].title
          : "The console is silent";
      const since = answer === null ? "" : ` This page shows the state at ${clockLabel(heardAt)}.`;
      words = `${why}.${since} Asking again …`;
      tone = "bad";
    }
    setHidden(this.banner, words === "");
    setData(this.banner, "tone", tone);
    setText(this.banner, words);
  }

  private showMessage(phase: PollPhase): void {
    const { trouble } = this.pollState;
    const [robots, shown] = [this.robots.length, this.shown.length];
    const message =
      this.link.token === null
        ? NO_LINK
        : messageOf(phase, { trouble, robots, shown, query: this.tools.query });
    const key = message?.key ?? (phase === "loading" ? "loading" : "");
    if (key === this.messageKey) return;
    this.messageKey = key;
    if (message !== null) this.place.replaceChildren(messageElement(message, () => this.tools.clear()));
    else if (phase === "loading") this.place.replaceChildren(loadingElement());
    else this.place.replaceChildren(this.grid);
  }
}

/** Places of tiles that are not known yet. */
function loadingElement(): HTMLElement {
  const places = Array.from({ length: 4 }, () => h("li", "tile-place is-empty", {}, h("div", "tile")));
  return h(
    "div",
    "fleet-loading",
    {},
    h("p", "loading-words muted", { role: "status" }, "Loading the robots …"),
    h("ul", "fleet-grid", { "aria-hidden": "true" }, ...places),
  );
}
