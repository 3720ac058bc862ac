import { axisValues, neutralValues } from "../drive/axis_mapping";
import * as arming from "../drive/arming";
import * as driver from "../drive/driver";
import {
  applyMessage,
  createConsoleState,
  forgetConnection,
  holdsSeat,
  mayDrive,
  note,
  robotIsUp,
} from "../session/console_state";
import { capHolds, cappedShare, viewDelay } from "../drive/speed_cap";
import { STALE_MS } from "../drive/feedback_age";
import { notePicture } from "../drive/latency";
import { CALM_INTERVAL_MS, noteHeard, noteShown, setPacing } from "../drive/command_gate";
import { restartInterlock, snapshotOf } from "../drive/restart_interlock";
import type { EpisodePress } from "../gamepad/episode_presses";
import { createRateMeter, noteOccurrence } from "../util/samples";
import { parseServerMessage } from "../protocol/wire_parser";
import { ARM_REFUSAL_LABELS } from "../drive/labels/labels";
import { Controls, type ControlSample } from "../input/controls";
import { Display } from "../input/display";
import { Disposal } from "../input/disposal";
import { keepKeyboardFree } from "../input/pointer_focus";
import { SendTimer } from "../input/send_timer";
import { Ticker } from "../input/ticker";
import { watchPage } from "../input/page_lifecycle";
import type { TouchSticks } from "../input/touch_sticks";
import { AudioDevice } from "../media/sound/audio_device";
import { MediaStreams } from "../media/media_streams";
import type { VideoStream } from "../media/video_stream";
import { Haptics } from "../haptics/haptics";
import { Heartbeat } from "../transport/heartbeat";
import { Connection, type ConnectionState } from "../transport/connection";
import type { ConsoleApi } from "../transport/signalling/console_api";
import { firstReader, type Preconnection } from "../transport/webrtc/preconnection";
import type { ChannelName, Peer, PeerOptions } from "../transport/peer";
import type { StampReader } from "../transport/encoded_transform/stamp_reader";
import { SessionClient } from "../session/session_client";
import type { ActionClient } from "../robot/action_client";
import type { ActConditions } from "../robot/actions";
import { reportOf } from "./report";
import type { HeadsetStep } from "./headset_statistics";
import { LateInbox } from "./late_inbox";
import type { Tracing } from "./tracing";
import type { GoalDriving } from "../drive/goals/goal_driving";
import { StopSender } from "./stop_sender";
import type { Talkback } from "../talkback/talkback";
import type {
  Action,
  ClientMessage,
  Feedback,
  RobotState,
  ServerMessage,
  StreamInfo,
  Welcome,
} from "../protocol/wire";

export interface ConsoleEngineEvents {
  canvas(info: StreamInfo): HTMLCanvasElement;
  mainStream(): string | null; // name of the camera in the large view
  isOccupied(): boolean; // a text field has the keyboard, or something stands over the pictures
  armedChanged(): void;
  actionPressed(index: number): void; // on a gamepad: as its button on the page
  feedbackTaken(now: number): void; // pictures may have become stale
  pictureDrawn(): void; // of the main stream
}

/** An input that is told so late waited behind a page that was held up. */
const HELD_UP_MS = 50;

/** What is called at every tick. */
interface Stepped {
  step(now: number): void;
}

/** The page's engine: connection, driving and media. What it shows is read from its fields. */
export class ConsoleEngine {
  readonly state = createConsoleState();
  readonly arming = arming.createArming();
  readonly streams: MediaStreams;
  readonly connection: Connection;
  readonly stopping: StopSender;
  readonly session: SessionClient;
  actions: ActionClient | null = null; // until its code is there, after the first picture
  readonly controls: Controls;
  readonly events = createRateMeter();
  readonly audio = new AudioDevice();
  readonly display = new Display();
  charts: Stepped | null = null; // until its code is there
  padEpisode: ((press: EpisodePress) => void) | null = null; // likewise
  headset: HeadsetStep | null = null; // while its session lasts
  talkback: Talkback | null = null; // likewise
  connectionState: ConnectionState = { kind: "connecting" };
  driver: driver.Driver | null = null;
  layer = 0;
  values: readonly (number | null)[] = []; // commanded now
  goals: GoalDriving | null = null; // until its code is there; goal axes stay where they are before
  viewDelayMs: number | null = null; // how late the pictures are now; null: not known
  speedShare = 1; // of full speed that the cap leaves
  firstPictureMs: number | null = null;
  readonly haptics = new Haptics(this);
  tracing: Tracing | null = null; // until its code is there, after the first picture
  readonly ticker: Ticker;
  private readonly disposal = new Disposal();
  peer: Peer | null = null;
  measuredMs: number | null = null; // when the newest feedback came
  readonly late = new LateInbox((channel, detail) => this.unreadable(channel, detail));
  statusMs = 0; // when the robot's newest status came
  actionMs = -Infinity; // when the newest news of an action came
  private heardMs = 0;
  private readonly sendTimer = new SendTimer(() => this.takeInput(performance.now()));
  private readonly heartbeat = new Heartbeat({
    tell: (message) => this.tell("control", message),
    report: () => reportOf(this),
    lost: (now) => this.driver !== null && driver.driverLoss(this.driver, now),
  });

  constructor(
    api: ConsoleApi,
    options: PeerOptions,
    name: string | null,
    sticks: TouchSticks,
    readonly page: ConsoleEngineEvents,
    first: Preconnection | null,
    private readonly reader: StampReader | null = first === null ? firstReader() : first.pending.reader,
  ) {
    this.streams = new MediaStreams(this.state, this.reader, this.audio, {
      canvas: (info) => page.canvas(info),
      visible: () => this.display.visible,
      drawn: (stream, stamp, at) => this.drawn(stream, stamp, at),
    });
    this.connection = new Connection(api, this.reader, options, first, {
      state: (link) => (this.connectionState = link),
      message: (channel, data, at) => this.received(channel, data, at),
      opened: (peer) => (this.peer = peer),
      streams: (peer, streams) => this.streams.reopen(peer, streams),
      closed: () => this.connectionClosed(),
    });
    this.stopping = new StopSender(api, this.connection);
    this.session = new SessionClient(this.state, name, (message) => this.tell("session", message));
    this.controls = new Controls(sticks, {
      stop: () => this.stop("stop key"),
      arm: () => this.toggleArmed(),
      nextLayer: () => this.nextLayer(),
      action: (index) => page.actionPressed(index),
      episode: (press) => this.padEpisode?.(press),
      actionKey: (index, code) => {
        const { description } = this.state.robot ?? {};
        const drives = description?.layers.some((layer) =>
          layer.bindings.some((each) => each.key_positive === code || each.key_negative === code),
        );
        if (drives !== false || index >= (description?.actions.length ?? 0)) return false;
        page.actionPressed(index);
        return true;
      },
      isArmed: () => this.isArmed(),
      answerClaim: (grant) => this.session.answerShown(grant),
      lost: () => this.disarm("pad_lost"),
      silent: () => this.disarm("pad_silent"),
      changed: (at) => this.inputChanged(at),
      plugged: (words) => note(this.state, "info", words, Date.now()),
    });
    if (this.reader === null)
      note(this.state, "error", "This browser cannot read stamps: no picture passes the gate", Date.now());
    this.watchPage();
    keepKeyboardFree(this.disposal);
    this.ticker = new Ticker(this.disposal, {
      tick: (now) => this.tick(now),
      poll: (now) => {
        if (this.controls.hasPadNews) this.takeInput(now);
      },
    });
  }

  isArmed(): boolean {
    return this.arming.state !== "disarmed";
  }

  /** Whether the console is connected and speaks. */
  hears(now: number): boolean {
    return this.state.welcome !== null && this.silentMs(now) < STALE_MS;
  }

  /** Whether no message to and from the console is lost: it is connected by a WebSocket. */
  get isReliable(): boolean {
    return this.peer?.isReliable === true;
  }

  /** Since the console's last message. */
  silentMs(now: number): number {
    return now - this.heardMs;
  }

  conditions(now = performance.now()): arming.ArmConditions {
    const { state } = this;
    return {
      operator: mayDrive(state),
      connected: this.hears(now),
      robotUp: robotIsUp(state),
      holdsSeat: holdsSeat(state),
      lockedOut: state.stop.locked_out !== "",
      stopped: state.stop.stopped,
      stopPressed: this.stopping.outranks(state.stop, now),
      visible: this.display.visible,
      occupied: !this.display.isImmersive && this.page.isOccupied(),
    };
  }

  /** `remote`: asked by a pad or a key, which work wherever the eyes are; a click is on a button that is seen. */
  actConditions(now: number, remote: boolean): ActConditions {
    const all = this.conditions(now);
    const { operator, connected, robotUp, holdsSeat, lockedOut, stopped, stopPressed } = all;
    return {
      visible: !remote || (all.visible && document.hasFocus()),
      occupied: remote && all.occupied,
      ...{ operator, connected, robotUp, holdsSeat, lockedOut },
      stopped: stopped || stopPressed,
      armed: this.isArmed(),
      proven: this.driver?.unproven === false,
      deadman: this.arming.state === "driving",
    };
  }

  /** Asks for an action once. Armed commands let it go on until it ends, or this page disarms. */
  act(action: Action, parameters: Readonly<Record<string, boolean | number | string>>): void {
    const now = performance.now();
    const nonce = this.state.feedback?.nonce ?? 0;
    if (this.actions?.act(action, parameters, nonce, now) === true) this.drive(now);
  }

  toggleArmed(): void {
    if (this.isArmed()) {
      this.disarm("operator");
      return;
    }
    if (this.session.takeOver()) return; // armed by the next press, once the seat is here
    const refusal = arming.arm(this.arming, this.conditions(), this.controls.deadman);
    if (refusal !== null) note(this.state, "warning", ARM_REFUSAL_LABELS[refusal], Date.now());
    else if (this.driver !== null) driver.driverArm(this.driver);
    this.page.armedChanged();
  }

  disarm(reason: arming.DisarmReason): void {
    if (!arming.disarm(this.arming, reason)) return;
    this.controls.release();
    this.haptics.still();
    this.actions?.forget();
    if (this.driver !== null) driver.driverDisarm(this.driver, performance.now());
    this.drive(performance.now());
    this.page.armedChanged();
  }

  stop(reason: string): void {
    this.stopping.stop(reason, performance.now());
    this.bar("stop_pressed");
  }

  /** Nothing moves before the person arms again, not even by the neutral command that would let it. */
  private bar(reason: arming.DisarmReason): void {
    if (this.driver !== null) driver.driverBar(this.driver);
    this.disarm(reason);
  }

  nextLayer(): void {
    this.selectLayer((this.layer + 1) % Math.max(1, this.state.robot?.description.layers.length ?? 1));
  }

  /** The layers' inputs mean different axes, so switching brings the robot to rest first. */
  selectLayer(layer: number): void {
    if (layer === this.layer) return;
    this.layer = layer;
    if (this.arming.state === "driving" && this.driver !== null)
      driver.driverRelease(this.driver, performance.now());
  }

  releaseSeat(): void {
    this.disarm("operator");
    this.session.release();
  }

  /** A setting changed: the gates take it at once. */
  settingsChanged(): void {
    const { pacing, tolerance } = this.state.settings;
    if (this.driver !== null) setPacing(this.driver.gate, pacing, tolerance.video);
    this.streams.changed();
  }

  async close(): Promise<void> {
    this.disarm("operator");
    this.talkback?.close();
    this.disposal.close();
    this.sendTimer.set(null);
    this.controls.close();
    this.connection.close();
    this.streams.close();
    this.reader?.close();
    this.haptics.close();
    await this.audio.close();
  }

  private watchPage(): void {
    watchPage(this.disposal, {
      blurred: () => this.blurred(),
      left: () => {
        this.disarm("hidden");
        this.connection.close();
      },
      visibilityChanged: () => {
        if (!this.display.visible) this.disarm("hidden");
        this.streams.listen();
      },
      networkChanged: () => this.connection.alarm(),
    });
  }

  /** Without the window's focus nobody knows which keys are held. A headset's controllers need no focus. */
  private blurred(): void {
    if (this.display.isImmersive && !this.controls.usesWindow) this.controls.keyboard.release();
    else this.disarm("blur");
  }

  private connectionClosed(): void {
    this.disarm("connection_lost");
    this.haptics.forget();
    this.tracing?.connectionClosed();
    this.peer = null;
    this.driver = null;
    this.streams.close();
    this.heartbeat.end();
    forgetConnection(this.state);
    this.late.newest.clear();
    this.measuredMs = null;
  }

  private received(channel: ChannelName, data: unknown, at: number): void {
    const parsed = parseServerMessage(data);
    if (parsed.kind !== "message") {
      if (parsed.kind === "malformed") this.unreadable(channel, parsed.detail);
      else if (!this.late.received(channel, parsed.type, parsed.value, at))
        this.unreadable(channel, parsed.type);
      return;
    }
    this.ticker.catchUp(performance.now());
    this.heardMs = at;
    const { feedback, handOver } = this.state;
    const snapshot = snapshotOf(this.state);
    applyMessage(this.state, parsed.message, Date.now());
    this.stopping.took(parsed.message, this.state, this.heardMs);
    const awaits = this.driver !== null && driver.driverAwaitsNeutral(this.driver, parsed.message);
    const forbidden = restartInterlock(snapshot, this.state, parsed.message, awaits);
    if (forbidden !== null) this.bar(forbidden);
    this.follow(parsed.message, feedback, this.heardMs);
    if (this.state.handOver !== handOver) this.handedOver();
  }

  private unreadable(channel: ChannelName, detail: string): void {
    this.state.badMessages += 1;
    note(this.state, "warning", `Unreadable message on ${channel}: ${detail}`, Date.now());
  }

  private follow(message: ServerMessage, before: Feedback | null, now: number): void {
    if (message.type === "feedback" && this.state.feedback === message)
      this.tookFeedback(message, before, now);
    else if (message.type === "refusal" && this.driver !== null) {
      driver.driverRefusal(this.driver, message, this.isArmed());
      this.goals?.refused(message, now);
      this.tracing?.book.noteRefused(message.event);
      this.drive(now);
    } else if (message.type === "pong") this.tookPong(message.id, now);
    else if (message.type === "welcome") this.welcomed(message);
    else if (message.type === "robot") this.robotChanged(message, now);
    else if (message.type === "seat") this.session.seatMs = now;
    else if (message.type === "status") this.statusMs = now;
    else if (message.type === "action") {
      this.actionMs = Math.max(this.actionMs, now - message.age * 1000);
      this.actions?.updated(message);
    }
  }

  /** Whoever drives next has to arm, and nothing of the one before is executed. */
  private handedOver(): void {
    this.disarm("seat_lost");
    if (this.state.handOver?.fromMe === true) this.session.lostSeat();
    if (holdsSeat(this.state)) arming.startAfresh(this.arming);
    else if (this.driver !== null) driver.driverSilence(this.driver);
  }

  private tookFeedback(feedback: Feedback, before: Feedback | null, now: number): void {
    if (before?.event !== feedback.event) noteOccurrence(this.events, now);
    this.measuredMs = now;
    this.haptics.took(feedback, now);
    if (this.driver !== null) driver.driverFeedback(this.driver, feedback, this.canCommand(), now);
    if (this.isArmed() && this.controls.hasPadNews) this.takeInput(now);
    else this.drive(now);
    this.streams.changed();
    this.page.feedbackTaken(now);
    this.tracing?.book.noteAnswered(feedback.event, now, performance.now());
  }

  private tookPong(id: number, now: number): void {
    const roundTripMs = this.heartbeat.answered(id, now);
    if (roundTripMs === null) return;
    this.state.roundTripMs = roundTripMs;
    if (this.driver !== null) driver.driverPingAnswered(this.driver, roundTripMs);
  }

  private welcomed(welcome: Welcome): void {
    this.connectionState = { kind: "connected" };
    this.heartbeat.observes = welcome.role === "observer";
    if (this.peer !== null) {
      this.peer.id = welcome.peer;
      this.heartbeat.isSlow = this.peer.isRelayed;
      this.heartbeat.isReliable = this.peer.isReliable;
      this.streams.open(this.peer, welcome.streams);
    }
    this.talkback?.attach(this.peer?.voiceSender(welcome.voice) ?? null);
    this.session.welcomed(welcome);
  }

  private robotChanged(robot: RobotState, now: number): void {
    if (robot.link === "down" && this.driver !== null) driver.driverSilence(this.driver);
    if (this.driver !== null) return;
    const { axes, layers, hold, max_event_rate: rate } = robot.description;
    const { settings, feedback } = this.state;
    const { pacing, tolerance } = settings;
    this.driver = driver.createDriver(
      pacing,
      tolerance.video,
      1000 / rate,
      neutralValues(axes),
      CALM_INTERVAL_MS,
      hold * 1000,
    );
    this.heartbeat.begin();
    this.layer = Math.min(this.layer, Math.max(0, layers.length - 1));
    if (feedback !== null) driver.driverFeedback(this.driver, feedback, this.canCommand(), now);
  }

  private canCommand(): boolean {
    return arming.mayCommand(this.conditions());
  }

  private tick(now: number): void {
    this.takeInput(now, true);
    this.ticker.hurry(this.isArmed() && this.controls.hasPad);
    this.streams.listen();
    this.talkback?.step(now);
    this.stopping.step(now);
    this.charts?.step(now);
    this.headset?.step(now);
    this.haptics.step(now);
    this.tracing?.step(now);
    if (this.state.welcome !== null) this.heartbeat.step(now);
    this.connection.step(now);
  }

  /**
   * A key or a finger did something. What waited behind a page that was held up is not what is held now: the tick that
   * follows takes that. That nothing is held any more counts at once, however late it is told.
   */
  private inputChanged(at: number): void {
    const now = performance.now();
    if (!this.isArmed()) return;
    const isFresh = now - at < HELD_UP_MS && !this.ticker.isLate(now);
    if (isFresh || !this.controls.deadman) this.takeInput(now);
  }

  /** Takes what the operator holds now, and sends what follows from it. */
  private takeInput(now: number, isTick = false): void {
    const sample = this.controls.sample(isTick);
    const lost = arming.lostCondition(this.conditions(now));
    if (lost !== null) this.disarm(lost);
    const change = arming.sampleDeadman(this.arming, sample.deadman, sample.signature, now);
    this.capSpeed(now);
    this.takeValues(sample, now);
    this.tracing?.noteIntention(this.values, now);
    if (change !== null) this.haptics.stick?.stop();
    if (this.driver !== null && change === "released") driver.driverRelease(this.driver, now);
    if (this.driver !== null && change === "taped_down") driver.driverDisarm(this.driver, now);
    if (change === "taped_down") this.page.armedChanged();
    this.drive(now);
  }

  private takeValues({ held, slowShare }: ControlSample, now: number): void {
    const { robot, feedback } = this.state;
    if (robot === null) {
      this.values = [];
      return;
    }
    const { description } = robot;
    const { axes } = description;
    const layer = description.layers[this.layer];
    const share = slowShare * this.speedShare;
    const drives = this.arming.state === "driving";
    const values = drives ? axisValues(axes, layer, held, share) : neutralValues(axes);
    const moves = drives && this.driver !== null && driver.driverMayMove(this.driver);
    const inputs = { description, layer, held, share, feedback, moves };
    this.values = this.goals?.take(values, inputs, now) ?? values;
  }

  /** The console learns at once when the delay becomes known: until then it keeps the robot slow. */
  private capSpeed(now: number): void {
    const { state } = this;
    const delay = this.driver === null ? null : viewDelay(this.driver.latency, now);
    const wasKnown = this.viewDelayMs !== null;
    this.viewDelayMs = delay;
    this.speedShare = this.isArmed() ? cappedShare(state.speedCap, state.settings.speedCap, delay) : 1;
    if (!wasKnown && delay !== null && capHolds(state.speedCap, state.settings.speedCap))
      this.tell("control", reportOf(this));
  }

  private drive(now: number): void {
    if (this.driver === null || this.state.welcome === null) return;
    noteHeard(this.driver.gate, this.streams.heard(), now);
    const intention = {
      armed: this.isArmed(),
      values: this.values,
      speed: this.goals?.speed ?? 1,
      action: this.actions?.renewed(now) ?? "",
    };
    const messages = driver.driverStep(this.driver, intention, this.canCommand(), now);
    for (const message of messages) {
      this.tell("control", message);
      this.tracing?.noteSent(message, now);
    }
    this.sendTimer.set(this.isArmed() ? driver.driverOpensIn(this.driver, intention, now) : null);
  }

  tell(channel: ChannelName, message: ClientMessage): boolean {
    return this.connection.send(channel, JSON.stringify(message));
  }

  private drawn(stream: VideoStream, stamp: number | null, at: number): void {
    this.firstPictureMs ??= at;
    this.tracing?.noteDrawn(stream.info.stream, stream.drawn);
    if (stamp === null || stream.info.stream !== this.page.mainStream() || this.driver === null) return;
    notePicture(this.driver.latency, stamp, at);
    noteShown(this.driver.gate, stamp);
    this.page.pictureDrawn();
    this.ticker.catchUp(performance.now());
    this.drive(at);
  }
}
