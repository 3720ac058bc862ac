import { seatAction, seatStanding, type SeatAction } from "../core/seat_standing";
import { robotIsUp } from "../core/console_state";
import { seatWords, type Obstacle } from "../core/seat_words";
import type { SeatNews } from "../core/seat_news";
import type { ConsoleApp } from "../console_app";
import { button, h, setData, setHidden, setText, type Panel } from "./dom";

/** News are told this long. */
const NEWS_MS = 10_000;

/** Who drives, who asks for it, and the one button for it: always in the same place. */
export function createSeatBar(app: ConsoleApp, talk: Panel): Panel {
  const title = h("strong", "seat-title");
  const text = h("span", "seat-text");
  const why = h("span", "seat-why");
  const grant = seatButton("Grant", "F8", () => app.session.answerShown(true));
  const decline = seatButton("Decline", "F9", () => app.session.answerShown(false));
  const keep = seatButton("Keep control", "", () => app.session.keepSeat());
  const action: HTMLButtonElement = seatButton("", "", () => act(app, action.dataset.kind));
  action.classList.add("seat-action");
  const words = h("div", "seat-words", {}, title, text);
  const spoken = h("span", "unseen", { role: "status" }); // without the seconds, which would be read out all the time
  const buttons = h("div", "seat-buttons", {}, talk.element, keep, grant, decline, why, action);
  const element = h(
    "section",
    "seat",
    { "aria-label": "Control seat" },
    h("span", "seat-lamp"),
    words,
    buttons,
    spoken,
  );
  let told: SeatNews | null = null;
  let toldMs = -Infinity;
  return {
    element,
    update(now) {
      const { state, session } = app;
      if (state.seatNews !== told) {
        told = state.seatNews;
        toldMs = now;
      }
      const me = state.welcome?.peer ?? null;
      const standing = seatStanding(state.seat, me);
      const claims = session.claims(now);
      const found = seatWords({
        role: state.welcome?.role ?? null,
        standing,
        holder: state.seat?.name ?? "",
        claims,
        me,
        idleSeconds: session.idleSecondsLeft(now),
        armed: app.isArmed(),
        obstacle: obstacleOf(app, now),
        news: told !== null && now - toldMs < NEWS_MS ? told.words : null,
      });
      session.shownClaim = found.tone === "asked" ? (claims[0]?.peer ?? null) : null;
      setData(element, "tone", found.tone);
      setText(title, found.title);
      setText(text, found.text);
      setText(spoken, found.tone === "asked" || found.tone === "idle" ? found.title : (told?.words ?? ""));
      setHidden(grant, found.tone !== "asked");
      setHidden(decline, found.tone !== "asked");
      setHidden(keep, found.tone !== "idle");
      showAction(action, why, actionOf(app));
      talk.update(now);
    },
  };
}

function obstacleOf(app: ConsoleApp, now: number): Obstacle | null {
  if (!app.hears(now)) return "silent";
  if (!robotIsUp(app.state)) return "robot_down";
  if (app.state.stop.locked_out !== "") return "locked_out";
  return app.state.stop.stopped ? "stopped" : null;
}

function actionOf(app: ConsoleApp): SeatAction | null {
  const { welcome, seat } = app.state;
  return seatAction(app.session.role, seatStanding(seat, welcome?.peer ?? null));
}

/** Does what the button says: the seat may have changed since it was last drawn. */
function act(app: ConsoleApp, shown: string | undefined): void {
  if (shown === "request") app.session.requestSeat();
  else if (shown === "take") app.session.takeSeat();
  else if (shown === "withdraw") app.session.release();
  else if (shown === "release") app.releaseSeat();
}

function showAction(element: HTMLButtonElement, why: HTMLElement, action: SeatAction | null): void {
  setHidden(element, action === null);
  setHidden(why, action === null || action.why === null);
  if (action === null) return;
  setText(element, action.label);
  setText(why, action.why ?? "");
  setData(element, "kind", action.kind);
  if (element.disabled !== (action.why !== null)) element.disabled = action.why !== null;
}

/** Keeps no focus: the space bar is the deadman and must not press it again. */
function seatButton(label: string, key: string, onclick: () => void): HTMLButtonElement {
  const element = button("seat-button", label, () => {
    onclick();
    element.blur();
  });
  if (key !== "") element.append(h("kbd", "seat-key", {}, key));
  return element;
}
