import type { ConsoleEngine } from "../../engine/console_engine";
import { axesShown } from "../../drive/axes_shown";
import { drivingKeys } from "../../input/shortcuts";
import { FIELDS } from "../../input/keyboard";
import type { ShadowVerdict } from "../../protocol/wire";
import { policyView, shadowAxes, shadowWords, type PolicyOffer } from "../../session/policies";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";

/** The time for which a shadow's last word is shown, in ms. */
const FRESH_MS = 1500;
const GIVE_KEY = "F2";

interface Shadow {
  readonly verdict: ShadowVerdict;
  readonly heardMs: number;
}

/** Policies: which of them drives or may be let, the one press that takes the robot back, and what shadows want. */
export function createPolicyBar(engine: ConsoleEngine): Panel {
  const shadows = new Map<string, Shadow>(); // by peer
  let eventMs = 0; // when the event changed
  let event = 0;
  let shown: readonly PolicyOffer[] = [];
  const title = h("strong", "policy-title", { role: "status" });
  const text = h("span", "policy-text");
  const takeOver = press("Take over", "policy-take", "F8", () => engine.session.takeOver());
  const withdraw = press("Withdraw the offer", "policy-withdraw", "", () => offer("", false));
  const offers = h("span", "policy-offers");
  const bars = h("div", "policy-shadows", { role: "group", "aria-label": "What shadow policies want" });
  const element = h("section", "policy-bar", { "aria-label": "Policies" });
  const line = h("div", "policy-line");
  line.append(h("span", "policy-lamp", { "aria-hidden": "true" }), title, text, withdraw, offers, takeOver);
  element.append(line, bars);

  /** Lets a policy drive, which frees an own seat, or no longer. `peer`: the only one that may; "": any. */
  function offer(peer: string, offered: boolean): void {
    engine.connection.tell("session", { type: "seat_offer", peer, offered });
  }

  /** The person gives the robot out of their hands: whatever they hold is let go first. */
  function give(wanted: PolicyOffer | undefined): void {
    if (wanted === undefined) return;
    engine.driving.disarm("operator");
    offer(wanted.peer, true);
  }

  engine.late.take["shadow_verdict"] = (message): void => {
    if (message.type === "shadow_verdict")
      shadows.set(message.peer, { verdict: message, heardMs: performance.now() });
  };
  addEventListener("keydown", (key) => {
    if (key.code !== GIVE_KEY || key.repeat || key.ctrlKey || key.metaKey || key.altKey) return;
    if (key.target instanceof Element && key.target.matches(FIELDS)) return;
    if (shown.length !== 1) return; // with several the person says which
    if (engine.driving.isArmed() && drivingKeys(engine.state.robot?.description ?? null).has(key.code))
      return;
    key.preventDefault();
    give(shown[0]);
  });

  return {
    element,
    update(now) {
      const { state } = engine;
      const current = state.feedback?.event ?? 0;
      if (current !== event) [event, eventMs] = [current, now];
      const view = policyView({
        role: state.welcome?.role ?? null,
        me: state.welcome?.peer ?? null,
        seat: state.seat,
        participants: state.participants,
        silentMs: now - eventMs,
        stopped: state.stop.stopped,
      });
      setHidden(element, view === null);
      if (view === null) {
        shown = [];
        return;
      }
      setData(element, "tone", view.tone);
      setText(title, view.title);
      setText(text, view.text);
      setHidden(takeOver, !view.takesOver);
      setHidden(withdraw, !view.withdraws);
      showOffers(view.offers);
      showShadows(now);
    },
  };

  function showOffers(wanted: readonly PolicyOffer[]): void {
    const same =
      wanted.length === shown.length &&
      wanted.every((each, at) => each.label === shown[at]?.label && each.peer === shown[at].peer);
    shown = wanted;
    if (same) return;
    offers.replaceChildren(
      ...wanted.map((each) =>
        press(each.label, "policy-offer", wanted.length === 1 ? GIVE_KEY : "", () => give(each)),
      ),
    );
  }

  function showShadows(now: number): void {
    const { robot, feedback, seat } = engine.state;
    for (const [peer, { heardMs }] of shadows) {
      if (now - heardMs >= FRESH_MS || seat?.holder === peer) shadows.delete(peer);
    }
    setHidden(bars, shadows.size === 0);
    if (robot === null || feedback === null || shadows.size === 0) {
      bars.replaceChildren();
      return;
    }
    const { description } = robot;
    const names = axesShown(description, engine.driving.layer);
    const done = description.axes.map((axis, index) =>
      axis.kind === "goal" ? (feedback.goals[index] ?? feedback.axes[index]) : feedback.axes[index],
    );
    bars.replaceChildren(
      ...[...shadows.values()].map(({ verdict }) => {
        const words = h("span", "shadow-words", {}, `${verdict.name} ${shadowWords(verdict)}`.trim());
        setData(words, "judgement", verdict.judgement);
        const row = h("div", "shadow-row", {}, words);
        for (const axis of shadowAxes(description, names, verdict, done)) {
          const fill = h("span", "shadow-done");
          fill.style.left = percent(axis.done);
          const track = h("span", "shadow-track", { title: axis.label }, fill);
          if (axis.wanted !== null) {
            const mark = h("span", "shadow-wanted");
            mark.style.left = percent(axis.wanted);
            track.append(mark);
          }
          row.append(h("span", "shadow-axis", {}, h("span", "shadow-label", {}, axis.label), track));
        }
        return row;
      }),
    );
  }
}

/** Keeps no focus: the space bar is the deadman and must not press it again. */
function press(label: string, name: string, key: string, act: () => void): HTMLButtonElement {
  const element = button(`policy-button ${name}`, label, () => {
    act();
    element.blur();
  });
  if (key !== "") element.append(h("kbd", "seat-key", {}, key));
  return element;
}

function percent(share: number): string {
  return `${(share * 100).toFixed(1)}%`;
}
