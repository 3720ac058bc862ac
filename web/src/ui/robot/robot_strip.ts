import { actRefusal, isRunning, movingNow, newestOf } from "../../robot/actions";
import { feedbackAge } from "../../drive/feedback_age";
import { ACT_REFUSAL_LABELS } from "../../robot/act_refusal_labels";
import { actionTone, actionWords } from "../../robot/action_labels";
import { shownItems } from "../../robot/status_items";
import { holdsSeat, mayDrive, note } from "../../session/console_state";
import type { ConsoleEngine } from "../../engine/console_engine";
import type { Action, ActionUpdate } from "../../protocol/wire";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";
import { createParameterForm, type ParameterForm } from "./parameter_form";
import { actConditions } from "../../engine/act_conditions";

/** How long the end of an action stays in words. */
const SHOWN_MS = 8000;
/** How long a question waits for its second click. */
const CONFIRM_MS = 5000;

export interface RobotStrip extends Panel {
  /** Asks for the action of the button at this place, by a pad or a key; of one that is not there nothing happens. */
  press(index: number): void;
}

/** A button for each action of the robot, and what the robot says of itself. Its height never changes. */
export function createRobotStrip(engine: ConsoleEngine): RobotStrip {
  engine.state.actionWords = actionWords;
  const status = h("ul", "status-items", { "aria-label": "Status of the robot", tabindex: "0" });
  const buttons = h("div", "action-buttons", { role: "group", "aria-label": "Actions of the robot" });
  const words = h("p", "action-words", { role: "status" });
  const element = h("section", "robot-strip", { "aria-label": "Robot" }, buttons, words, status);
  let actions: readonly ActionButton[] = [];
  let described: readonly Action[] | null = null;
  let shownStatus = "";
  return {
    element,
    press: (index) => actions.filter((each) => !each.isByClick)[index]?.press(true),
    update(now) {
      const { state } = engine;
      const wanted = state.robot?.description.actions ?? described ?? [];
      if (wanted !== described) {
        described = wanted;
        actions = wanted.map((action) => new ActionButton(engine, action));
        buttons.replaceChildren(...actions.map((each) => each.element));
      }
      const isSilent = feedbackAge(engine.measuredMs, now) !== null;
      const items = shownItems(state.status, now - engine.statusMs, isSilent);
      const hasButtons = mayDrive(state) && actions.length > 0;
      setHidden(buttons, !hasButtons);
      for (const each of actions) each.update(now);
      showWords(engine, words, now);
      setHidden(element, !hasButtons && items.length === 0 && words.textContent === "");
      const key = JSON.stringify(items);
      if (key === shownStatus) return;
      shownStatus = key;
      status.replaceChildren(
        ...items.map((item) =>
          h(
            "li",
            "status-item",
            { "data-tone": item.tone, title: item.detail, "data-item": item.name },
            h("span", "chip-dot"),
            h("span", "status-label", {}, item.label),
            h("strong", "status-value", {}, item.value),
            h("span", "status-detail", {}, item.detail),
          ),
        ),
      );
    },
  };
}

/** The action that runs, or how the last one ended. */
function showWords(engine: ConsoleEngine, element: HTMLElement, now: number): void {
  const { actions, robot } = engine.state;
  const running = movingNow(actions) ?? actions.findLast(isRunning) ?? null;
  const last = actions.at(-1) ?? null;
  const update = running ?? (last !== null && now - engine.actionMs < SHOWN_MS ? last : null);
  const label = robot?.description.actions.find((each) => each.name === update?.name)?.label;
  setText(
    element,
    update === null ? whyNot(engine, now) : actionWords({ label: label ?? update.name }, update),
  );
  setData(element, "tone", update === null ? "off" : actionTone(update));
  element.title = update === null ? "" : `${element.textContent}, by ${update.by}`;
}

/** Why the first action that cannot be asked for cannot; "" for whoever may not drive. */
function whyNot(engine: ConsoleEngine, now: number): string {
  const { state } = engine;
  if (!mayDrive(state)) return "";
  for (const action of state.robot?.description.actions ?? []) {
    const refusal = actRefusal(action, state.actions, actConditions(engine, now, false));
    if (refusal !== null) return `${action.label}: ${ACT_REFUSAL_LABELS[refusal]}`;
  }
  return "";
}

/** One action: asks, shows its progress, cancels. */
class ActionButton {
  readonly element: HTMLElement;
  private readonly main: HTMLButtonElement;
  private readonly fill = h("span", "action-fill");
  private readonly label = h("span", "action-label");
  private readonly form: ParameterForm;
  private askedMs = -Infinity; // when the question was put

  constructor(
    private readonly engine: ConsoleEngine,
    private readonly action: Action,
  ) {
    this.main = button("action-button", "", () => this.press(false));
    this.main.append(this.fill, this.label);
    this.form = createParameterForm(action);
    this.element = h("div", "action", { "data-action": action.name }, this.main, ...this.form.elements);
  }

  update(now: number): void {
    const { engine, action } = this;
    const update = newestOf(engine.state.actions, action.name);
    const runs = update !== null && isRunning(update);
    const refusal = runs ? null : actRefusal(action, engine.state.actions, actConditions(engine, now, false));
    const asks = !runs && now - this.askedMs < CONFIRM_MS;
    const mayCancel = runs && (holdsSeat(engine.state) || engine.state.welcome?.role === "supervisor");
    setText(
      this.label,
      runs ? `Cancel ${action.label}` : asks ? `${action.confirm} Press again` : action.label,
    );
    const isOff = refusal !== null || (runs && !mayCancel);
    this.main.setAttribute("aria-disabled", String(isOff));
    setHidden(this.element, this.isByClick && !runs); // else it has nothing to be asked with
    this.main.title = refusal === null ? "" : ACT_REFUSAL_LABELS[refusal];
    setData(this.element, "state", runs ? "running" : asks ? "asking" : stateWord(update, engine, now));
    this.fill.style.width = runs ? `${update.progress * 100}%` : "0";
    this.form.disable(runs);
  }

  /** A click on a picture asks for it, never a button. */
  get isByClick(): boolean {
    const cameras = this.engine.state.robot?.description.cameras ?? [];
    return cameras.some((camera) => camera.click === this.action.name);
  }

  press(remote: boolean): void {
    const { engine, action } = this;
    const now = performance.now();
    const update = newestOf(engine.state.actions, action.name);
    if (update !== null && isRunning(update)) {
      engine.actions?.cancel(update.id);
      return;
    }
    if (this.isByClick) return;
    const refusal = actRefusal(action, engine.state.actions, actConditions(engine, now, remote));
    if (refusal !== null) {
      note(engine.state, "warning", `${action.label}: ${ACT_REFUSAL_LABELS[refusal]}`, Date.now());
      return;
    }
    if (action.confirm !== "" && now - this.askedMs >= CONFIRM_MS) {
      this.askedMs = now;
      return;
    }
    this.askedMs = -Infinity;
    const parameters = this.form.values();
    if (parameters === null)
      note(engine.state, "warning", `${action.label}: a value does not fit`, Date.now());
    else engine.act(action, parameters);
  }
}

function stateWord(update: ActionUpdate | null, engine: ConsoleEngine, now: number): string {
  if (update === null || engine.state.actions.at(-1) !== update || now - engine.actionMs >= SHOWN_MS)
    return "idle";
  return update.state;
}
