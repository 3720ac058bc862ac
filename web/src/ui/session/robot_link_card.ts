import {
  codeLabel,
  loopbackWarning,
  refusedLabel,
  robotLinkAbout,
  robotLinkTitle,
  waitLabel,
  type PairingCode,
  type RobotLink,
} from "../../session/robot_link";
import type { RobotLinkApi } from "../../transport/signalling/robot_link_api";
import { requestErrorLabel } from "../../transport/signalling/session_api";
import { createCopyField } from "../elements/copy_field";
import { button, h, setData, setHidden, setText } from "../elements/dom";

const REFRESH_MS = 1000;
/** A second click within this time forgets the robot. */
const CONFIRM_MS = 4000;

export interface RobotLinkCard {
  readonly element: HTMLElement;
  /** Asks the console now, and again each second until `stop`. */
  refresh(): void;
  stop(): void;
}

function clock(since: number): string {
  return new Date(since * 1000).toLocaleTimeString([], { timeStyle: "short" });
}

/** One robot that dials in: whether it is paired and there, its pairing code, and its end. */
export function createRobotLinkCard(api: RobotLinkApi, name = ""): RobotLinkCard {
  const title = h("h3", "robot-link-title");
  const about = h("p", "robot-link-about");
  const pair = button("field-button primary", "Pair a robot", () => void act(openCode));
  const forget = button("revoke-button", "Forget", () => askToForget());
  const code = h("output", "pairing-code", { "aria-label": "Pairing code" });
  const copy = createCopyField("Command for the robot's computer", "The command is copied");
  const cancel = button("field-button quiet", "Withdraw the code", () => void act(closeCode));
  const steps = h("p", "muted", {}, "On the robot's computer, with the robot's own name instead of NAME:");
  const warning = h("p", "pairing-warning");
  const shown = h("div", "pairing-shown", {}, code, steps, copy.element, warning, cancel);
  const words = h("p", "pairing-words", { role: "status" });
  const refused = h("p", "pairing-refused", { role: "alert" });
  const waits = h("div", "robot-waits", { role: "status" }); // there before what it is to announce
  let shownWaits = "";
  const trouble = h("p", "form-trouble", { role: "alert" });
  const head = h("div", "robot-link-head", {}, h("div", "", {}, title, about), pair, forget);
  const element = h("section", "robot-link", { "aria-label": name === "" ? "Robot link" : name });
  if (name !== "") element.append(h("h3", "list-head", {}, name));
  element.append(head, waits, shown, words, refused, trouble);
  let made: PairingCode | null = null; // the code that this page has made
  let timer: ReturnType<typeof setTimeout> | undefined;
  let asking: ReturnType<typeof setTimeout> | undefined;
  let asked = 0;
  for (const part of [pair, forget, shown]) setHidden(part, true);

  return { element, refresh, stop };

  function refresh(): void {
    clearTimeout(timer);
    const mine = ++asked;
    api.state().then(
      (link) => show(mine, link, ""),
      (error: unknown) => show(mine, null, requestErrorLabel(error)),
    );
  }

  function stop(): void {
    asked += 1;
    made = null; // a code is told once
    clearTimeout(timer);
  }

  function show(mine: number, link: RobotLink | null, problem: string): void {
    if (mine !== asked) return;
    if (link !== null) render(link);
    setText(trouble, problem);
    timer = setTimeout(refresh, REFRESH_MS);
  }

  function render(link: RobotLink): void {
    if (link.code !== "waiting") made = null;
    const isOpen = link.code === "waiting";
    setData(element, "state", link.state);
    setText(title, link.dialsIn ? robotLinkTitle(link) : "The console connects to this robot");
    const time = new Date(link.at * 1000).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
    setText(about, link.dialsIn ? robotLinkAbout(link, time) : "It does not dial in, so nothing is paired.");
    setHidden(pair, !link.mayPair || link.state !== "unpaired" || made !== null);
    setText(pair, link.code === "none" ? "Pair a robot" : "New code");
    setHidden(forget, !link.mayPair || link.key !== "paired");
    setHidden(shown, !isOpen || !link.mayPair);
    setHidden(code, made === null);
    setHidden(steps, made === null);
    setHidden(copy.element, made === null);
    const elsewhere = made === null ? "" : loopbackWarning(made.command);
    setText(warning, elsewhere);
    setHidden(warning, elsewhere === "");
    setText(code, made?.code ?? "");
    setText(words, codeLabel(link));
    setData(words, "tone", isOpen ? "waits" : link.code === "paired" ? "good" : "bad");
    setText(refused, refusedLabel(link));
    renderWaits(link);
  }

  /** Writes only what changed, so that each robot is read out once. */
  function renderWaits(link: RobotLink): void {
    const rows = link.waits.map((each) => [waitLabel(each, link), clock(each.since)] as const);
    const now = JSON.stringify(rows);
    if (now === shownWaits) return;
    shownWaits = now;
    const items = rows.map(([label, since]) =>
      h("li", "", {}, label, " ", h("span", "muted", {}, `Since ${since}.`)),
    );
    waits.replaceChildren(
      ...(items.length === 0
        ? []
        : [h("ul", "", { role: "list", "aria-label": "Robots that wait" }, ...items)]),
    );
  }

  async function openCode(): Promise<void> {
    made = await api.openCode();
    copy.show(made.command);
  }

  async function closeCode(): Promise<void> {
    await api.closeCode();
  }

  async function forgetRobot(): Promise<void> {
    await api.forget();
  }

  async function act(work: () => Promise<void>): Promise<void> {
    pair.disabled = cancel.disabled = forget.disabled = true;
    try {
      await work();
      refresh();
    } catch (error) {
      setText(trouble, requestErrorLabel(error));
    } finally {
      pair.disabled = cancel.disabled = forget.disabled = false;
    }
  }

  function askToForget(): void {
    const sure = forget.classList.contains("is-asking");
    clearTimeout(asking);
    forget.classList.toggle("is-asking", !sure);
    setText(forget, sure ? "Forget" : "Really?");
    if (sure) void act(forgetRobot);
    else
      asking = setTimeout(() => {
        forget.classList.remove("is-asking");
        setText(forget, "Forget");
      }, CONFIRM_MS);
  }
}
