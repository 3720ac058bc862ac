import type {
  Action,
  ActionUpdate,
  Feedback,
  Participant,
  Quality,
  RecordingState,
  Refusal,
  RobotState,
  Seat,
  ServerMessage,
  SharedNote,
  SourceStatus,
  SpeedCapState,
  Status,
  StopState,
  Voice,
  Welcome,
} from "../protocol/wire";
import type { Pacing } from "../drive/command_gate";
import { requestAnswer, type SeatNotice } from "./seat/seat_notices";
import { seatHandover, type SeatHandover } from "./seat/seat_handover";
import type { GateMode } from "../gate/media_gate";
import { isNewer } from "../gate/serial";
import { resetRefusalLabel } from "../stop/reset_labels";
import { actionNamed, isRunning, takeUpdate } from "../robot/actions";
import { sourceLabel } from "./source_labels";
import { REFUSAL_LABELS } from "./refusal_labels";

export interface Settings {
  tolerance: { video: number; audio: number }; // events; 4 and 6
  pacing: Pacing;
  gate: GateMode; // "event" is the rule
  speedCap: boolean; // slower the later the picture
  contactTone: boolean;
  rumble: boolean;
  soundWanted: boolean;
}

/** A line of the log; the same one again only counts up. */
export interface LogLine {
  readonly level: "info" | "warning" | "error";
  readonly text: string;
  count: number;
  atMs: number; // Date.now() of the newest
}

/** What the page knows of the other side. One object; everything that shows or drives reads it. */
export interface ConsoleState {
  readonly settings: Settings;
  readonly log: LogLine[]; // newest first
  welcome: Welcome | null; // null while not connected
  robot: RobotState | null;
  seat: Seat | null;
  handOver: SeatHandover | null; // the last one
  seatNotice: SeatNotice | null; // what was last to be told about the seat, a new object each time
  participants: readonly Participant[];
  quality: Quality | null; // of this peer's pictures
  speedCap: SpeedCapState | null; // the console's; null before it has said so
  sources: readonly SourceStatus[]; // cameras and microphones of the console's own
  voice: Voice | null; // who is heard at the robot; null before the console has said so
  recording: RecordingState | null; // null before the console has said so
  notes: SharedNote[]; // oldest first
  actions: readonly ActionUpdate[]; // of the robot, oldest request first
  actionWords: (action: Pick<Action, "label">, update: ActionUpdate) => string; // of the page's later files, when they are there
  status: Status | null; // what the robot says of itself; null before it has
  feedback: Feedback | null; // newest
  stop: StopState;
  stopIsHeard: boolean; // on this connection; else it is of an earlier one
  roundTripMs: number | null;
  badMessages: number; // could not be read
}

const LOG_LIMIT = 40;
const NOTE_LIMIT = 100;
const NOT_STOPPED: StopState = {
  stopped: false,
  by: "",
  reason: "",
  number: 0,
  press: "",
  kept: true,
  locked_out: "",
};

export function createConsoleState(): ConsoleState {
  return {
    settings: {
      tolerance: { video: 4, audio: 6 },
      pacing: "feedback",
      gate: "event",
      speedCap: false,
      contactTone: false,
      rumble: true,
      soundWanted: true,
    },
    log: [],
    welcome: null,
    robot: null,
    seat: null,
    handOver: null,
    seatNotice: null,
    participants: [],
    quality: null,
    speedCap: null,
    sources: [],
    voice: null,
    recording: null,
    notes: [],
    actions: [],
    actionWords: (action, update) => `${action.label}: ${update.state} ${update.text}`.trim(),
    status: null,
    feedback: null,
    stop: NOT_STOPPED,
    stopIsHeard: false,
    roundTripMs: null,
    badMessages: 0,
  };
}

/** Forgets what belonged to the connection that ended. A stop stays shown until the robot says otherwise. */
export function forgetConnection(state: ConsoleState): void {
  state.welcome = null;
  state.robot = null;
  state.seat = null;
  state.participants = [];
  state.quality = null;
  state.speedCap = null;
  state.sources = [];
  state.voice = null;
  state.recording = null;
  state.notes = [];
  state.actions = [];
  state.status = null;
  state.feedback = null;
  state.stopIsHeard = false;
  state.roundTripMs = null;
}

export function isOperator(state: ConsoleState): boolean {
  return state.welcome?.role === "operator";
}

/** Whether this link may drive at all. */
export function mayDrive(state: ConsoleState): boolean {
  return isOperator(state) || state.welcome?.role === "supervisor";
}

export function holdsSeat(state: ConsoleState): boolean {
  return state.seat !== null && state.seat.holder !== "" && state.seat.holder === state.welcome?.peer;
}

export function policyDrives(state: ConsoleState): boolean {
  return state.seat?.kind === "policy";
}

export function robotIsUp(state: ConsoleState): boolean {
  return state.robot?.link === "up";
}

/** Takes what a message says about the other side; commands and latencies are the driver's. */
export function applyMessage(state: ConsoleState, message: ServerMessage, wallMs: number): void {
  switch (message.type) {
    case "welcome":
      state.welcome = message;
      return;
    case "robot":
      state.robot = message;
      if (message.link === "down") note(state, "error", `Robot link down: ${message.detail}`, wallMs);
      return;
    case "seat":
      takeSeat(state, message, wallMs);
      return;
    case "participants":
      state.participants = message.participants;
      return;
    case "notice":
      note(state, message.level, message.text, wallMs);
      return;
    case "stop_state":
      takeStop(state, message.stop);
      return;
    case "refusal":
      takeRefusal(state, message, wallMs);
      return;
    case "feedback":
      if (isNews(state.feedback, message)) takeFeedbackState(state, message);
      return;
    case "quality":
      state.quality = message;
      return;
    case "speed_cap":
      state.speedCap = message;
      return;
    case "sources":
      takeSources(state, message.sources, wallMs);
      return;
    case "voice":
      state.voice = message;
      return;
    case "recording":
      takeRecording(state, message, wallMs);
      return;
    case "note_shared":
      state.notes.push(message);
      state.notes.splice(0, state.notes.length - NOTE_LIMIT);
      return;
    case "action":
      takeAction(state, message, wallMs);
      return;
    case "status":
      state.status = message;
      return;
    case "pong":
    case "shadow_verdict": // the policy bar's
    case "episode": // the episode bar's
    case "episode_answer":
    case "stop_taken": // the stop sender's
    case "traces": // the charts'
    case "navigation": // the map's
      return;
    default:
      message satisfies never;
  }
}

export function note(state: ConsoleState, level: LogLine["level"], text: string, wallMs: number): void {
  const last = state.log[0];
  if (last?.text === text && last.level === level) {
    last.count += 1;
    last.atMs = wallMs;
    return;
  }
  state.log.unshift({ level, text, count: 1, atMs: wallMs });
  state.log.length = Math.min(state.log.length, LOG_LIMIT);
}

function isNews(known: Feedback | null, feedback: Feedback): boolean {
  if (known === null) return true;
  if (known.event === feedback.event) return feedback.issue > known.issue;
  return isNewer(feedback.event, known.event);
}

function takeFeedbackState(state: ConsoleState, feedback: Feedback): void {
  state.feedback = feedback;
  takeStop(state, feedback.stop);
}

/** Numbers only grow, and the two ways that tell of a stop overtake each other: what names an older one is late. */
function takeStop(state: ConsoleState, stop: StopState): void {
  if (state.stopIsHeard && stop.number < state.stop.number) return;
  state.stop = stop;
  state.stopIsHeard = true;
}

/** How an action ends is a line of the log. */
function takeAction(state: ConsoleState, update: ActionUpdate, wallMs: number): void {
  const known = state.actions.find((each) => each.id === update.id);
  state.actions = takeUpdate(state.actions, update);
  if (isRunning(update) || known?.state === update.state) return;
  if (update.state === "done" && update.text === "") return;
  const label = actionNamed(state.robot?.description ?? null, update.name)?.label ?? update.name;
  note(
    state,
    update.state === "done" ? "info" : "warning",
    state.actionWords({ label }, update),
    wallMs - update.age * 1000,
  );
}

/** A failure is said once, in the log too. */
function takeRecording(state: ConsoleState, recording: RecordingState, wallMs: number): void {
  if (recording.state === "failed" && state.recording?.state !== "failed")
    note(state, "error", `Recording failed: ${recording.detail}`, wallMs);
  state.recording = recording;
}

function takeSeat(state: ConsoleState, seat: Seat, wallMs: number): void {
  const change = seatHandover(state.seat, seat, state.welcome?.peer ?? null);
  if (state.seat === null) state.seatNotice = null; // of an earlier connection, whose seat this one may contradict
  state.seat = seat;
  if (change === null) return;
  state.handOver = change;
  state.seatNotice = { words: change.words };
  note(state, "info", change.words, wallMs);
}

/** A camera that fails, one that works again, and who publishes one: each a line. The first state is none by itself. */
function takeSources(state: ConsoleState, sources: readonly SourceStatus[], wallMs: number): void {
  for (const source of sources) {
    const before = state.sources.find((each) => each.stream === source.stream)?.state;
    if (before === source.state || source.state === "connecting") continue;
    const failed = sourceLabel(source);
    if (failed !== null) {
      if (before !== undefined) note(state, "warning", `${source.label}: ${failed}`, wallMs);
    } else {
      const said = [before === "reconnecting" ? "back" : "", source.detail].filter((words) => words !== "");
      if (said.length > 0) note(state, "info", `${source.label} is ${said.join(", ")}`, wallMs);
    }
  }
  state.sources = sources;
}

/** A page that only looked whether the seat is free asked for nothing, so nothing was refused. */
function takeRefusal(state: ConsoleState, refusal: Refusal, wallMs: number): void {
  const answer = requestAnswer(refusal, state.seat?.name ?? "");
  if (answer !== null) state.seatNotice = { words: answer };
  if (refusal.reason === "seat_taken" && answer === null) return;
  if (refusal.stop > 0) {
    note(state, "warning", resetRefusalLabel(refusal), wallMs);
    return;
  }
  note(state, "warning", answer ?? refusalWords(refusal), wallMs);
}

function refusalWords(refusal: Refusal): string {
  const detail = refusal.detail === "" ? "" : ` (${refusal.detail})`;
  return `Refused: ${REFUSAL_LABELS[refusal.reason]}${detail}`;
}
