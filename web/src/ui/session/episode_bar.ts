import type { ConsoleEngine } from "../../engine/console_engine";
import type { EpisodePress } from "../../gamepad/episode_presses";
import { drivingKeys } from "../../input/shortcuts";
import { FIELDS } from "../../input/keyboard";
import type { EpisodeRequest, EpisodeState, ServerMessage } from "../../protocol/wire";
import { drawId } from "../../robot/action_client";
import { holdsSeat, isOperator, note } from "../../session/console_state";
import {
  EPISODE_REFUSALS,
  episodeLabels,
  hasLost,
  isSilent,
  leftEpisode,
  problemWords,
  spokenProblems,
  unknownWords,
  withLeftEpisode,
  type LeftEpisode,
} from "../../session/episode_labels";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";
import { actConditions } from "../../engine/act_conditions";

type Request = Pick<EpisodeRequest, "do"> & Partial<EpisodeRequest>;

/** The time for which a refusal stays readable, in ms. */
const SHOWN_MS = 6000;
const TASK_LIMIT = 300;

/** The request of each key; foot pedals are keys. */
const KEYS: ReadonlyMap<string, Request> = new Map<string, Request>([
  ["KeyB", { do: "start" }],
  ["KeyK", { do: "keep" }],
  ["KeyY", { do: "keep", outcome: "success" }],
  ["KeyN", { do: "keep", outcome: "failure" }],
  ["KeyL", { do: "discard" }],
  ["KeyO", { do: "redo" }],
  ["KeyM", { do: "mark" }],
]);

/** The requests of a gamepad; what one button means depends on the phase. */
const PRESSES: Readonly<Record<Exclude<EpisodePress, "begin_or_success">, Request>> = {
  failure: { do: "keep", outcome: "failure" },
  keep: { do: "keep" },
  discard: { do: "discard" },
  redo: { do: "redo" },
  mark: { do: "mark" },
};
const ENDS: ReadonlySet<EpisodeRequest["do"]> = new Set(["keep", "discard", "redo"]);
const LET_GO = "let go of the button to hold first";

interface EpisodeButton {
  readonly element: HTMLButtonElement;
  readonly works: (state: EpisodeState) => boolean;
}

/** Begins, keeps and discards episodes, and says what would spoil the one that is open. */
export function createEpisodeBar(engine: ConsoleEngine): Panel {
  let state: EpisodeState | null = null;
  let left: LeftEpisode | null = null; // open when the connection ended; null: none was, or its fate is known
  let heardMs = 0;
  let beganMs: number | null = null; // when this page saw the open episode begin; null: it did not
  let refusal = "";
  let refusedMs = -Infinity;

  const isOpen = (each: EpisodeState): boolean => each.phase === "open";
  const lamp = h("span", "episode-lamp", { "aria-hidden": "true" });
  const words = h("strong", "episode-words", { role: "status" });
  const time = h("span", "episode-time"); // apart from the words, which are read aloud when they change
  const count = h("span", "episode-count");
  const problems = h("span", "episode-problems", { "aria-hidden": "true" });
  const spoken = h("span", "unseen", { role: "alert" });
  const task = h("input", "episode-task", {
    "aria-label": "Task of the episode",
    placeholder: "Task, in words",
    maxlength: String(TASK_LIMIT),
    enterkeyhint: "go",
  });
  const form = h("form", "episode-form", {}, task);
  const buttons: readonly EpisodeButton[] = [
    make(
      "Begin",
      "B, pad: R3 with A",
      { do: "start" },
      (each) => each.phase === "idle" || each.phase === "resetting",
    ),
    make("Keep", "K, pad: R3 with Y", { do: "keep" }, isOpen),
    make("Success", "Y, pad: R3 with A", { do: "keep", outcome: "success" }, isOpen),
    make("Failure", "N, pad: R3 with X", { do: "keep", outcome: "failure" }, isOpen),
    make(
      "Discard",
      "L, pad: R3 with LB",
      { do: "discard" },
      (each) => isOpen(each) || each.phase === "countdown",
    ),
    make("Redo", "O, pad: R3 with L3", { do: "redo" }, isOpen),
    make("Mark", "M, pad: R3 with up on the cross", { do: "mark" }, isOpen),
  ];
  const group = h("div", "episode-buttons", { role: "group", "aria-label": "Episode" });
  group.append(...buttons.map((each) => each.element));
  const element = h("section", "episode-bar", { "aria-label": "Episodes" });
  element.append(h("div", "episode-state", {}, lamp, words, time, problems, spoken, count), form, group);

  function make(
    label: string,
    key: string,
    request: Request,
    works: (state: EpisodeState) => boolean,
  ): EpisodeButton {
    const made = button("episode-button", label, () => ask(request));
    made.title = `${label}: key ${key}`;
    setData(made, "episode", `${request.do}${request.outcome === undefined ? "" : `-${request.outcome}`}`);
    return { element: made, works };
  }

  /** Whether this person may ask, by the rule of the console, which decides in the end. */
  const may = (): boolean =>
    holdsSeat(engine.state) ||
    engine.state.welcome?.role === "supervisor" ||
    (engine.state.seat?.offered === true && isOperator(engine.state));

  /** Each request names the episode that the page shows, so that a late request never ends a later episode. */
  function ask(request: Request): void {
    if (state === null || !may()) return;
    const { do: verb } = request;
    const message: EpisodeRequest = {
      type: "episode_request",
      id: drawId(),
      episode: verb === "start" ? "" : state.episode,
      task: verb === "start" ? task.value.trim() : "",
      ...request,
    };
    engine.connection.tell("session", message);
  }

  /**
   * The right stick is pressed by accident while driving, and the buttons beside it begin actions: whatever ends an
   * episode is asked for with the robot let go.
   */
  function takePress(press: EpisodePress): void {
    if (element.hidden || state === null) return;
    if (document.activeElement === task) task.blur();
    const { visible, occupied } = actConditions(engine, performance.now(), true);
    if (!visible || occupied) return;
    const isIdle = state.phase === "idle" || state.phase === "resetting";
    const succeeds: Request = { do: "keep", outcome: "success" };
    const request =
      press !== "begin_or_success" ? PRESSES[press] : isIdle ? { do: "start" as const } : succeeds;
    if (engine.controls.deadman && ENDS.has(request.do)) refuse(LET_GO);
    else ask(request);
  }

  function refuse(why: string): void {
    [refusal, refusedMs] = [why, performance.now()];
    note(engine.state, "warning", `Episode: ${refusal}`, Date.now());
  }

  function take(said: ServerMessage | undefined): void {
    if (said?.type === "episode") {
      const before = left ?? leftEpisode(state);
      const message = withLeftEpisode(said, before);
      const isOpenQuestion = said.reads_recordings && message !== said;
      const isAnswered = left !== null && !isOpenQuestion;
      left = isOpenQuestion ? before : null;
      if (state?.task !== message.task && document.activeElement !== task && message.task !== "")
        task.value = message.task;
      if (hasLost(message) && message.last !== state?.last)
        note(engine.state, "error", `Episode: ${message.last}`, Date.now());
      else if (isAnswered && message.last !== "")
        note(engine.state, message.lost === "" ? "info" : "error", `Episode: ${message.last}`, Date.now());
      const isSame = state?.phase === "open" && state.episode === message.episode;
      if (message.phase === "open" && !isSame) beganMs = state === null ? null : performance.now();
      [state, heardMs] = [message, performance.now()];
    } else if (said?.type === "episode_answer" && said.reason !== "") {
      refuse(EPISODE_REFUSALS[said.reason]);
    }
  }

  /** The episode that was open when the connection ended. */
  function showLeft(): void {
    setHidden(element, left === null);
    if (left === null) return;
    setData(element, "tone", "bad");
    setText(words, unknownWords(left));
    for (const each of [time, problems, spoken, count]) setText(each, "");
    for (const each of buttons) each.element.disabled = true;
  }

  take(engine.late.newest.get("episode")?.message);
  engine.padEpisode = takePress;
  engine.late.take["episode"] = engine.late.take["episode_answer"] = take;
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    task.blur(); // keys drive again
    ask({ do: "start" });
  });
  addEventListener("keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.metaKey || event.altKey || element.hidden) return;
    if (event.target instanceof Element && event.target.matches(FIELDS)) return;
    const request = KEYS.get(event.code);
    if (request === undefined) return;
    if (engine.driving.isArmed() && drivingKeys(engine.state.robot?.description ?? null).has(event.code))
      return;
    ask(request);
  });

  return {
    element,
    update(now) {
      const { recording, welcome } = engine.state;
      if (welcome === null) {
        if (!element.hidden) left ??= leftEpisode(state);
        state = null; // of a connection that ended
      }
      if (state === null) {
        showLeft();
        return;
      }
      const records = recording?.state === "recording" || recording?.state === "failed";
      setHidden(element, !may() || (!records && state.phase === "idle" && !hasLost(state) && left === null));
      if (element.hidden) return;
      const current = state;
      // The console's clock may be another: it counts only where the page came later.
      const seconds = Math.max(
        0,
        beganMs === null ? Date.now() / 1000 - current.since : (now - beganMs) / 1000,
      );
      const age = (now - heardMs) / 1000;
      const labels = episodeLabels(current, recording, age, seconds);
      const known = isSilent(current, age) ? [] : current.problems;
      const isRefused = now - refusedMs < SHOWN_MS;
      setData(element, "tone", isRefused ? "bad" : labels.tone);
      setText(words, isRefused ? `Not done: ${refusal}` : labels.text);
      words.title = words.textContent;
      setText(time, labels.time);
      setText(count, labels.count);
      setText(problems, problemWords(known));
      problems.title = problemWords(known);
      setHidden(problems, known.length === 0);
      setText(spoken, spokenProblems(known));
      setHidden(form, current.phase === "open" || current.phase === "keeping");
      task.disabled = current.phase === "countdown";
      for (const each of buttons) {
        each.element.disabled =
          !each.works(current) ||
          isSilent(current, age) ||
          (recording?.state !== "recording" && !isOpen(current));
      }
    },
  };
}
