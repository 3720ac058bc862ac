import * as arming from "../drive/arming";
import { axisValues, neutralValues } from "../drive/axis_mapping";
import { CALM_INTERVAL_MS, noteHeard, type HeardSound } from "../drive/command_gate";
import * as driver from "../drive/driver";
import type { GoalDriving } from "../drive/goals/goal_driving";
import { ARM_REFUSAL_LABELS } from "../drive/labels/labels";
import { capHolds, cappedShare, viewDelay } from "../drive/speed_cap";
import type { Controls, ControlSample } from "../input/controls";
import { SendTimer } from "../input/send_timer";
import type { ClientMessage, Feedback, RobotState } from "../protocol/wire";
import { note, type ConsoleState } from "../session/console_state";

export interface DrivingEvents {
  conditions(now: number): arming.ArmConditions;
  heard(): readonly HeardSound[]; // sound that plays
  action(now: number): string; // id of the moving action that commands renew; "" for none
  armedChanged(): void;
  disarmed(): void; // before the rest leaves
  intended(now: number, deadmanChanged: boolean): void; // `values` are new
  delayKnown(): void; // `viewDelayMs` was null before
  send(message: ClientMessage, now: number): void;
}

/** The operator's driving: from what is held to the commands that leave. */
export class Driving {
  readonly arming = arming.createArming();
  driver: driver.Driver | null = null; // of the robot that is connected
  layer = 0;
  values: readonly (number | null)[] = []; // commanded now
  goals: GoalDriving | null = null; // until its code is there; goal axes stay where they are before
  viewDelayMs: number | null = null; // how late the pictures are now; null: not known
  speedShare = 1; // of full speed that the cap leaves
  private readonly sendTimer = new SendTimer(() => this.take(performance.now()));

  constructor(
    private readonly state: ConsoleState,
    private readonly controls: Controls,
    private readonly events: DrivingEvents,
  ) {}

  isArmed(): boolean {
    return this.arming.state !== "disarmed";
  }

  /** Arms where the conditions permit it; else a note says why not. */
  arm(): void {
    const conditions = this.events.conditions(performance.now());
    const refusal = arming.arm(this.arming, conditions, this.controls.deadman);
    if (refusal !== null) note(this.state, "warning", ARM_REFUSAL_LABELS[refusal], Date.now());
    else if (this.driver !== null) driver.driverArm(this.driver);
    this.events.armedChanged();
  }

  disarm(reason: arming.DisarmReason): void {
    if (!arming.disarm(this.arming, reason)) return;
    this.controls.release();
    this.events.disarmed();
    if (this.driver !== null) driver.driverDisarm(this.driver, performance.now());
    this.step(performance.now());
    this.events.armedChanged();
  }

  /** Nothing moves before the person arms again, not even by the neutral command that would let it. */
  bar(reason: arming.DisarmReason): void {
    if (this.driver !== null) driver.driverBar(this.driver);
    this.disarm(reason);
  }

  /** The next layer unless one is given. Their inputs mean different axes: switching brings the robot to rest first. */
  selectLayer(wanted = this.layer + 1): void {
    const layer = wanted % Math.max(1, this.state.robot?.description.layers.length ?? 1);
    if (layer === this.layer) return;
    this.layer = layer;
    if (this.arming.state === "driving" && this.driver !== null)
      driver.driverRelease(this.driver, performance.now());
  }

  /** Takes what the operator holds now, and sends what follows from it. */
  take(now: number, isTick = false): void {
    const sample = this.controls.sample(isTick);
    const lost = arming.lostCondition(this.events.conditions(now));
    if (lost !== null) this.disarm(lost);
    const change = arming.sampleDeadman(this.arming, sample.deadman, sample.signature, now);
    this.capSpeed(now);
    this.values = this.valuesOf(sample, now);
    this.events.intended(now, change !== null);
    if (this.driver !== null && change === "released") driver.driverRelease(this.driver, now);
    if (this.driver !== null && change === "taped_down") driver.driverDisarm(this.driver, now);
    if (change === "taped_down") this.events.armedChanged();
    this.step(now);
  }

  /** Sends what is due. */
  step(now: number): void {
    if (this.driver === null || this.state.welcome === null) return;
    noteHeard(this.driver.gate, this.events.heard(), now);
    const intention = {
      armed: this.isArmed(),
      values: this.values,
      speed: this.goals?.speed ?? 1,
      action: this.events.action(now),
    };
    for (const message of driver.driverStep(this.driver, intention, this.canCommand(), now))
      this.events.send(message, now);
    this.sendTimer.set(this.isArmed() ? driver.driverOpensIn(this.driver, intention, now) : null);
  }

  /** Takes the state of the robot link. Returns whether this is the first of a connection, which makes the driver. */
  robotChanged(robot: RobotState, now: number): boolean {
    if (robot.link === "down" && this.driver !== null) driver.driverSilence(this.driver);
    if (this.driver !== null) return false;
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
    this.layer = Math.min(this.layer, Math.max(0, layers.length - 1));
    if (feedback !== null) driver.driverFeedback(this.driver, feedback, this.canCommand(), now);
    return true;
  }

  tookFeedback(feedback: Feedback, now: number): void {
    if (this.driver !== null) driver.driverFeedback(this.driver, feedback, this.canCommand(), now);
    if (this.isArmed() && this.controls.hasPadNews) this.take(now);
    else this.step(now);
  }

  /** The seat has another holder. Whoever drives next has to arm, and nothing of the one before is executed. */
  handedOver(holdsSeat: boolean): void {
    this.disarm("seat_lost");
    if (holdsSeat) arming.startAfresh(this.arming);
    else if (this.driver !== null) driver.driverSilence(this.driver);
  }

  close(): void {
    this.disarm("operator");
    this.sendTimer.set(null);
  }

  private canCommand(): boolean {
    return arming.mayCommand(this.events.conditions(performance.now()));
  }

  private valuesOf({ held, slowShare }: ControlSample, now: number): readonly (number | null)[] {
    const { robot, feedback } = this.state;
    if (robot === null) return [];
    const { description } = robot;
    const { axes } = description;
    const layer = description.layers[this.layer];
    const share = slowShare * this.speedShare;
    const drives = this.arming.state === "driving";
    const values = drives ? axisValues(axes, layer, held, share) : neutralValues(axes);
    const moves = drives && this.driver !== null && driver.driverMayMove(this.driver);
    const inputs = { description, layer, held, share, feedback, moves };
    return this.goals?.take(values, inputs, now) ?? values;
  }

  /** The console learns at once when the delay becomes known: until then it keeps the robot slow. */
  private capSpeed(now: number): void {
    const { state } = this;
    const delay = this.driver === null ? null : viewDelay(this.driver.latency, now);
    const wasKnown = this.viewDelayMs !== null;
    this.viewDelayMs = delay;
    this.speedShare = this.isArmed() ? cappedShare(state.speedCap, state.settings.speedCap, delay) : 1;
    if (!wasKnown && delay !== null && capHolds(state.speedCap, state.settings.speedCap))
      this.events.delayKnown();
  }
}
