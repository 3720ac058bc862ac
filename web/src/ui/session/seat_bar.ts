import { isMeant, seatAction, seatStatus, type SeatAction } from "../../session/seat/seat_status";
import { policyDrives, robotIsUp } from "../../session/console_state";
import { seatLabels, type Obstacle } from "../../session/seat/seat_labels";
import type { SeatNotice } from "../../session/seat/seat_notices";
import type { ConsoleEngine } from "../../engine/console_engine";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";

/** News are told this long. */
const NEWS_MS = 10_000;

/** Who drives, who asks for it, and the one button for it: always in the same place. */
export function createSeatBar(engine: ConsoleEngine, talk: Panel): Panel {
  const title = h("strong", "seat-title");
  const text = h("span", "seat-text");
  const why = h("span", "seat-why");
  const grant = seatButton("Grant", "F8", () => engine.session.answerShown(true));
  const decline = seatButton("Decline", "F9", () => engine.session.answerShown(false));
  const keep = seatButton("Keep control", "", () => engine.session.keepSeat());
  const action: HTMLButtonElement = seatButton("", "", () => act(engine, shown));
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
  const shown: Shown = { kind: null, sinceMs: -Infinity };
  let told: SeatNotice | null = null;
  let toldMs = -Infinity;
  return {
    element,
    update(now) {
      const { state, session } = engine;
      if (state.seatNotice !== told) {
        told = state.seatNotice;
        toldMs = now;
      }
      const me = state.welcome?.peer ?? null;
      const status = seatStatus(state.seat, me);
      const claims = session.claims(now);
      const found = seatLabels({
        role: state.welcome?.role ?? null,
        status: status,
        holder: state.seat?.name ?? "",
        policy: policyDrives(state),
        claims,
        me,
        idleSeconds: session.idleSecondsLeft(now),
        armed: engine.driving.isArmed(),
        obstacle: obstacleOf(engine, now),
        notice: told !== null && now - toldMs < NEWS_MS ? told.words : null,
      });
      session.shownClaim = found.tone === "asked" ? (claims[0]?.peer ?? null) : null;
      setData(element, "tone", found.tone);
      setData(element, "driver", state.seat?.kind ?? "none");
      setText(title, found.title);
      setText(text, found.text);
      setText(spoken, found.tone === "asked" || found.tone === "idle" ? found.title : (told?.words ?? ""));
      setHidden(grant, found.tone !== "asked");
      setHidden(decline, found.tone !== "asked");
      setHidden(keep, found.tone !== "idle");
      const offered = actionOf(engine);
      if ((offered?.kind ?? null) !== shown.kind)
        Object.assign(shown, { kind: offered?.kind ?? null, sinceMs: now });
      showAction(action, why, offered, now - shown.sinceMs);
      talk.update(now);
    },
  };
}

function obstacleOf(engine: ConsoleEngine, now: number): Obstacle | null {
  if (!engine.hears(now)) return "silent";
  if (!robotIsUp(engine.state)) return "robot_down";
  if (engine.state.stop.locked_out !== "") return "locked_out";
  return engine.state.stop.stopped ? "stopped" : null;
}

function actionOf(engine: ConsoleEngine): SeatAction | null {
  const { welcome, seat } = engine.state;
  return seatAction(engine.session.role, seatStatus(seat, welcome?.peer ?? null), policyDrives(engine.state));
}

/** What the button says, and since when. */
interface Shown {
  kind: SeatAction["kind"] | null;
  sinceMs: number;
}

/** Does what the button says: the seat may have changed since it was last drawn. */
function act(engine: ConsoleEngine, { kind }: Shown): void {
  if (kind === "request") engine.session.requestSeat();
  else if (kind === "take") engine.session.takeSeat();
  else if (kind === "withdraw") engine.session.release();
  else if (kind === "release") {
    engine.driving.disarm("operator");
    engine.session.release();
  }
}

function showAction(
  element: HTMLButtonElement,
  why: HTMLElement,
  action: SeatAction | null,
  shownMs: number,
): void {
  setHidden(element, action === null);
  setHidden(why, action === null || action.why === null);
  if (action === null) return;
  setText(element, action.label);
  setText(why, action.why ?? "");
  setData(element, "kind", action.kind);
  const disabled = action.why !== null || !isMeant(action.kind, shownMs);
  if (element.disabled !== disabled) element.disabled = disabled;
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
