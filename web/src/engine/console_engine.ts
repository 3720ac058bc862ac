import type { ArmConditions } from "../drive/arming";
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
import { STALE_MS } from "../drive/feedback_age";
import { notePicture } from "../drive/latency";
import { noteShown, setPacing } from "../drive/command_gate";
import { restartInterlock, snapshotOf } from "../drive/restart_interlock";
import type { EpisodePress } from "../gamepad/episode_presses";
import { createRateMeter, noteOccurrence } from "../util/samples";
import { parseServerMessage } from "../protocol/wire_parser";
import { Controls } from "../input/controls";
import { Display } from "../input/display";
import { Disposal } from "../input/disposal";
import { keepKeyboardFree } from "../input/pointer_focus";
import { Ticker } from "../input/ticker";
import { watchPage } from "../input/page_lifecycle";
import type { TouchSticks } from "../input/touch_sticks";
import { AudioDevice } from "../media/sound/audio_device";
import { MediaStreams } from "../media/media_streams";
import type { VideoStream } from "../media/video_stream";
import type { Haptics } from "../haptics/haptics";
import { Heartbeat } from "../transport/heartbeat";
import { Connection, type ConnectionState } from "../transport/connection";
import type { ConsoleApi } from "../transport/signalling/console_api";
import { firstReader, type Preconnection } from "../transport/webrtc/preconnection";
import type { ChannelName, Peer, PeerOptions } from "../transport/peer";
import type { StampReader } from "../transport/encoded_transform/stamp_reader";
import { SessionClient } from "../session/session_client";
import type { ActionClient } from "../robot/action_client";
import { Driving } from "./driving";
import { reportOf } from "./report";
import type { HeadsetStep } from "./headset_statistics";
import { LateInbox } from "./late_inbox";
import type { Tracing } from "./tracing";
import { StopSender } from "./stop_sender";
import type { Talkback } from "../talkback/talkback";
import type { Action, Feedback, ServerMessage, StreamInfo, Welcome } from "../protocol/wire";

export interface ConsoleEngineEvents {
  canvas(info: StreamInfo): HTMLCanvasElement;
  mainStream(): string | null; // name of the camera in the large view
  isOccupied(): boolean; // a text field has the keyboard, or something stands over the pictures
  armedChanged(): void;
  actionPressed(index: number): void; // on a gamepad: as its button on the page
  feedbackTaken(now: number): void; // pictures may have become stale
  pictureDrawn(): void; // of the main stream
}

/**
 * A key or a finger that is told so late waited behind a page that was held up: it is not what is held now, and the
 * tick that follows takes that. That nothing is held any more counts at once, however late it is told.
 */
const HELD_UP_MS = 50;

/** What is called at every tick. */
interface Stepped {
  step(now: number): void;
}

/** The page's engine: connection, driving and media. What it shows is read from its fields. */
export class ConsoleEngine {
  readonly state = createConsoleState();
  readonly driving: Driving;
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
  firstPictureMs: number | null = null;
  haptics: Haptics | null = null; // until its code is there
  tracing: Tracing | null = null; // until its code is there, after the first picture
  readonly ticker: Ticker;
  private readonly disposal = new Disposal();
  peer: Peer | null = null;
  measuredMs: number | null = null; // when the newest feedback came
  readonly late = new LateInbox((channel, detail) => this.unreadable(channel, detail));
  statusMs = 0; // when the robot's newest status came
  actionMs = -Infinity; // when the newest news of an action came
  heardMs = 0; // the console's last message
  private readonly heartbeat = new Heartbeat({
    tell: (message) => this.connection.tell("control", message),
    report: () => reportOf(this),
    lost: (now) => this.driving.driver !== null && driver.driverLoss(this.driving.driver, now),
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
    this.session = new SessionClient(this.state, name, (message) => this.connection.tell("session", message));
    this.controls = new Controls(sticks, {
      stop: () => this.stop("stop key"),
      arm: () => this.toggleArmed(),
      nextLayer: () => this.driving.selectLayer(),
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
      isArmed: () => this.driving.isArmed(),
      answerClaim: (grant) => this.session.answerShown(grant),
      lost: () => this.driving.disarm("pad_lost"),
      silent: () => this.driving.disarm("pad_silent"),
      changed: (at) => {
        const now = performance.now();
        if (!this.driving.isArmed()) return;
        const isFresh = now - at < HELD_UP_MS && !this.ticker.isLate(now);
        if (isFresh || !this.controls.deadman) this.driving.take(now);
      },
      plugged: (words) => note(this.state, "info", words, Date.now()),
    });
    this.driving = new Driving(this.state, this.controls, {
      conditions: (now) => this.conditions(now),
      heard: () => this.streams.heard(),
      action: (now) => this.actions?.renewed(now) ?? "",
      armedChanged: () => page.armedChanged(),
      disarmed: () => {
        this.haptics?.still();
        this.actions?.forget();
      },
      intended: (now, deadmanChanged) => {
        this.tracing?.noteIntention(this.driving.values, now);
        if (deadmanChanged) this.haptics?.stick?.stop();
      },
      delayKnown: () => this.connection.tell("control", reportOf(this)),
      send: (message, now) => {
        this.connection.tell("control", message);
        this.tracing?.noteSent(message, now);
      },
    });
    if (this.reader === null)
      note(this.state, "error", "This browser cannot read stamps: no picture passes the gate", Date.now());
    watchPage(this.disposal, {
      // Without the window's focus nobody knows which keys are held. A headset's controllers need no focus.
      blurred: () => {
        if (this.display.isImmersive && !this.controls.usesWindow) this.controls.keyboard.release();
        else this.driving.disarm("blur");
      },
      left: () => {
        this.driving.disarm("hidden");
        this.connection.close();
      },
      visibilityChanged: () => {
        if (!this.display.visible) this.driving.disarm("hidden");
        this.streams.listen();
      },
      networkChanged: () => this.connection.alarm(),
    });
    keepKeyboardFree(this.disposal);
    this.ticker = new Ticker(this.disposal, {
      tick: (now) => this.tick(now),
      poll: (now) => {
        if (this.controls.hasPadNews) this.driving.take(now);
      },
    });
  }

  /** Whether the console is connected and speaks. */
  hears(now: number): boolean {
    return this.state.welcome !== null && now - this.heardMs < STALE_MS;
  }

  conditions(now = performance.now()): ArmConditions {
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

  /** Asks for an action once. Armed commands let it go on until it ends, or this page disarms. */
  act(action: Action, parameters: Readonly<Record<string, boolean | number | string>>): void {
    const now = performance.now();
    const nonce = this.state.feedback?.nonce ?? 0;
    if (this.actions?.act(action, parameters, nonce, now) === true) this.driving.step(now);
  }

  toggleArmed(): void {
    if (this.driving.isArmed()) this.driving.disarm("operator");
    else if (!this.session.takeOver()) this.driving.arm(); // else by the next press, once the seat is here
  }

  stop(reason: string): void {
    this.stopping.stop(reason, performance.now());
    this.driving.bar("stop_pressed");
  }

  /** A setting changed: the gates take it at once. */
  settingsChanged(): void {
    const { pacing, tolerance } = this.state.settings;
    if (this.driving.driver !== null) setPacing(this.driving.driver.gate, pacing, tolerance.video);
    this.streams.changed();
  }

  async close(): Promise<void> {
    this.driving.close();
    this.talkback?.close();
    this.disposal.close();
    this.controls.close();
    this.connection.close();
    this.streams.close();
    this.reader?.close();
    this.haptics?.close();
    await this.audio.close();
  }

  private connectionClosed(): void {
    this.driving.disarm("connection_lost");
    this.haptics?.forget();
    this.tracing?.connectionClosed();
    this.peer = null;
    this.driving.driver = null;
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
    const { driving } = this;
    const awaits = driving.driver !== null && driver.driverAwaitsNeutral(driving.driver, parsed.message);
    const forbidden = restartInterlock(snapshot, this.state, parsed.message, awaits);
    if (forbidden !== null) driving.bar(forbidden);
    this.follow(parsed.message, feedback, this.heardMs);
    if (this.state.handOver === handOver) return;
    driving.handedOver(holdsSeat(this.state));
    if (this.state.handOver?.fromMe === true) this.session.lostSeat();
  }

  private unreadable(channel: ChannelName, detail: string): void {
    this.state.badMessages += 1;
    note(this.state, "warning", `Unreadable message on ${channel}: ${detail}`, Date.now());
  }

  private follow(message: ServerMessage, before: Feedback | null, now: number): void {
    const { driving } = this;
    if (message.type === "feedback" && this.state.feedback === message)
      this.tookFeedback(message, before, now);
    else if (message.type === "refusal" && driving.driver !== null) {
      driver.driverRefusal(driving.driver, message, driving.isArmed());
      driving.goals?.refused(message, now);
      this.tracing?.book.noteRefused(message.event);
      driving.step(now);
    } else if (message.type === "pong") {
      const roundTripMs = this.heartbeat.answered(message.id, now);
      if (roundTripMs === null) return;
      this.state.roundTripMs = roundTripMs;
      if (driving.driver !== null) driver.driverPingAnswered(driving.driver, roundTripMs);
    } else if (message.type === "welcome") this.welcomed(message);
    else if (message.type === "robot") {
      if (driving.robotChanged(message, now)) this.heartbeat.begin();
    } else if (message.type === "seat") this.session.seatMs = now;
    else if (message.type === "status") this.statusMs = now;
    else if (message.type === "action") {
      this.actionMs = Math.max(this.actionMs, now - message.age * 1000);
      this.actions?.updated(message);
    }
  }

  private tookFeedback(feedback: Feedback, before: Feedback | null, now: number): void {
    if (before?.event !== feedback.event) noteOccurrence(this.events, now);
    this.measuredMs = now;
    this.haptics?.took(feedback, now);
    this.driving.tookFeedback(feedback, now);
    this.streams.changed();
    this.page.feedbackTaken(now);
    this.tracing?.book.noteAnswered(feedback.event, now, performance.now());
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

  private tick(now: number): void {
    this.driving.take(now, true);
    this.ticker.hurry(this.driving.isArmed() && this.controls.hasPad);
    this.streams.listen();
    this.talkback?.step(now);
    this.stopping.step(now);
    this.charts?.step(now);
    this.headset?.step(now);
    this.haptics?.step(now);
    this.tracing?.step(now);
    if (this.state.welcome !== null) this.heartbeat.step(now);
    this.connection.step(now);
  }

  private drawn(stream: VideoStream, stamp: number | null, at: number): void {
    const { driving } = this;
    this.firstPictureMs ??= at;
    this.tracing?.noteDrawn(stream.info.stream, stream.drawn);
    if (stamp === null || stream.info.stream !== this.page.mainStream() || driving.driver === null) return;
    notePicture(driving.driver.latency, stamp, at);
    noteShown(driving.driver.gate, stamp);
    this.page.pictureDrawn();
    this.ticker.catchUp(performance.now());
    driving.step(at);
  }
}
