import { describe, expect, it } from "vitest";
import { applyMessage, createConsoleState } from "../../src/session/console_state";
import * as driver from "../../src/drive/driver";
import { restartInterlock, snapshotOf } from "../../src/drive/restart_interlock";
import type { Refusal, ServerMessage } from "../../src/protocol/wire";
import { feedbackOf, refusalOf, robotOf, stopOf, welcomeOf } from "../messages";
import { readVectors } from "../vectors";

interface Step {
  readonly t: number; // ms
  readonly do: "feedback" | "arm" | "move" | "let_go" | "refused" | "seat";
  readonly event?: number;
  readonly issue?: number;
  readonly stopped?: boolean;
  readonly stop_number?: number;
  readonly neutral_needed?: boolean;
  readonly reason?: Refusal["reason"];
  readonly leaves: readonly (readonly [number, "neutral" | "moving"])[];
}

interface Case {
  readonly name: string;
  readonly steps: readonly Step[];
}

const { cases } = readVectors("driving") as { cases: Case[] };
const NEUTRAL = [0];
const MOVING = [1];

/** The page without a page: what `ConsoleApp` does with a message, around the driver and the interlock. */
class Person {
  private readonly state = createConsoleState();
  private readonly driver = driver.createDriver("feedback", 4, 0, NEUTRAL);
  private armed = false;
  private values = NEUTRAL;

  constructor() {
    for (const message of [welcomeOf("operator"), robotOf("up")]) applyMessage(this.state, message, 0);
  }

  take(step: Step): void {
    const { t } = step;
    if (step.do === "feedback") {
      const stop = stopOf({ stopped: step.stopped ?? false, number: step.stop_number ?? 0 });
      const { event = 0, issue = 1, neutral_needed = false } = step;
      this.hear(feedbackOf(event, { issue, stop, neutral_needed }), t);
    } else if (step.do === "refused") this.hear(refusalOf(step.event ?? 0, step.reason ?? "late"), t);
    else if (step.do === "move") this.values = MOVING;
    else if (step.do === "arm") {
      this.armed = true;
      driver.driverArm(this.driver);
    } else this.disarm(t);
    if (step.do === "seat") driver.driverSilence(this.driver);
  }

  private hear(message: ServerMessage, now: number): void {
    const standing = snapshotOf(this.state);
    applyMessage(this.state, message, now);
    const awaits = driver.driverAwaitsNeutral(this.driver, message);
    if (restartInterlock(standing, this.state, message, awaits) !== null) {
      driver.driverBar(this.driver);
      this.disarm(now);
    }
    if (message.type === "feedback") driver.driverFeedback(this.driver, message, true, now);
    if (message.type === "refusal") driver.driverRefusal(this.driver, message, this.armed);
  }

  private disarm(now: number): void {
    if (this.armed) driver.driverDisarm(this.driver, now);
    this.armed = false;
  }

  leaving(now: number): unknown[] {
    const { inFlight } = this.driver.gate;
    const messages = driver.driverStep(this.driver, { armed: this.armed, values: this.values }, true, now);
    const first = messages.find((each) => each.type === "command" && inFlight === null);
    if (first?.type !== "command") return [];
    return [[first.event, first.values[0] === 0 ? "neutral" : "moving"]];
  }
}

describe("what leaves is what the shared cases say", () => {
  it.each(cases)("$name", ({ steps }) => {
    const person = new Person();
    steps.forEach((step, number) => {
      person.take(step);
      expect(person.leaving(step.t), `step ${number}: ${JSON.stringify(step)}`).toEqual(step.leaves);
    });
  });
});
