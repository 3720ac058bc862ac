import type { ConsoleState } from "../session/console_state";
import { isSilenced } from "../session/silenced";
import { createResetState, resetNotSent, resetNumber, tookResetRefusal } from "../stop/reset_state";
import {
  createPress,
  isBeingSaid,
  isPast,
  isUnkept,
  outranks,
  stopDue,
  stopFate,
  tookStopAnswer,
  tookStopState,
  tookStopTaken,
  unkeptSince,
  type StopFate,
  type StopPress,
} from "../stop/stop_press";
import { stopAnswerOf, type ConsoleApi } from "../transport/signalling/console_api";
import type { Connection } from "../transport/connection";
import type { ServerMessage, StopState } from "../protocol/wire";

/**
 * STOP and its reset. Says the newest press on every way there is, again and again until the robot confirms it. A press takes the
 * place of the one before: a robot that has the newer one is stopped for both.
 */
export class StopSender {
  readonly resetState = createResetState();
  private press: StopPress | null = null; // null: none, or it is done with
  private isSilenced = false; // the STOP of this page's link
  private unkeptMs: number | null = null; // since when what the robot says of its stop is not on its disk

  constructor(
    private readonly api: ConsoleApi,
    private readonly connection: Connection,
  ) {}

  /** What became of the newest press; null when there is nothing to tell. */
  fate(now: number): StopFate | null {
    return this.press === null ? null : stopFate(this.press, now);
  }

  /** Whether it is still said. */
  isSaid(now: number): boolean {
    return this.press !== null && isBeingSaid(this.press, now);
  }

  /** Whether a press may have stopped the robot although `stop` does not show it yet. */
  outranks(stop: StopState, now: number): boolean {
    return this.press !== null && outranks(this.press, stop, now);
  }

  /** Whether the robot could not save the stop that holds, whoever's it is. */
  isUnkept(now: number): boolean {
    return isUnkept(this.unkeptMs, now);
  }

  stop(reason: string, now: number): void {
    this.press = createPress(crypto.getRandomValues(new Uint8Array(16)), reason, now);
    this.step(now);
  }

  /** Resets the stop that is on screen, if it was there when the hand came to the button, at `heldMs`. */
  reset(heldMs: number, now: number): void {
    const number = resetNumber(this.resetState, heldMs);
    if (number === null) return;
    const text = JSON.stringify({ type: "reset", by: "", number });
    if (!this.connection.send("stop", text)) resetNotSent(this.resetState, now);
  }

  /** `state`: with this message taken. */
  took(message: ServerMessage, state: ConsoleState, now: number): void {
    const { stop } = state;
    if (message.type === "participants")
      this.noteSilence(isSilenced(state.participants, state.welcome?.peer ?? null));
    if (message.type === "refusal" && message.stop > 0) tookResetRefusal(this.resetState, message, now);
    this.unkeptMs = unkeptSince(this.unkeptMs, stop, now);
    const { press } = this;
    if (press === null) return;
    if (message.type === "stop_taken") tookStopTaken(press, message);
    else if (message.type === "refusal" && message.reason === "silenced")
      tookStopAnswer(press, { kind: "silenced" });
    tookStopState(press, stop, now);
    if (isPast(press, stop)) this.press = null;
  }

  /** To be called many times a second. */
  step(now: number): void {
    const { press } = this;
    if (press === null) return;
    const due = stopDue(press, now);
    if (due.channels) {
      const text = JSON.stringify({ type: "stop", by: "", reason: press.reason, press: press.id });
      this.connection.send("stop", text);
      this.connection.send("control", text);
    }
    if (due.http) void this.sayOverHttp(press);
  }

  /** When the STOP of this page's link works again, "had no effect" would be taken for now. */
  private noteSilence(isSilenced: boolean): void {
    if (this.isSilenced && !isSilenced && this.press?.heard === "silenced") this.press = null;
    this.isSilenced = isSilenced;
  }

  private async sayOverHttp(press: StopPress): Promise<void> {
    const answer = await stopAnswerOf(this.api.stop(press.reason, press.id), press.id);
    tookStopAnswer(press, answer);
  }
}
