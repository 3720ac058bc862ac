import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { noteShown } from "../../src/drive/command_gate";
import { notePicture } from "../../src/drive/latency";
import { Driving, type DrivingEvents } from "../../src/engine/driving";
import type { Controls } from "../../src/input/controls";
import { applyMessage, createConsoleState } from "../../src/session/console_state";
import type { ClientMessage, Feedback, RobotState } from "../../src/protocol/wire";
import { axisOf, descriptionOf, feedbackOf, robotOf, seatOf, welcomeOf } from "../messages";

const LAYER = {
  name: "base",
  label: "Base",
  bindings: [
    {
      ...{ axis: "vx", scale: 1, key_positive: "KeyW", key_negative: "KeyS" },
      ...{ pad: null, touch: null, invert_pad: false, invert_touch: false },
    },
  ],
};
const ROBOT: RobotState = {
  ...robotOf("up"),
  description: { ...descriptionOf([axisOf("vx")]), layers: [LAYER, { ...LAYER, name: "arm" }] },
};

/** An operator at a page without a page. */
class Operator {
  held = false; // the deadman, and a key that moves
  stopped = false;
  now = 1000;
  readonly state = createConsoleState();
  readonly sent: ClientMessage[] = [];
  readonly events = {
    conditions: () => ({
      operator: true,
      connected: true,
      robotUp: true,
      holdsSeat: true,
      lockedOut: false,
      stopped: this.stopped,
      stopPressed: false,
      visible: true,
      occupied: false,
    }),
    heard: () => [],
    action: () => "",
    armedChanged: vi.fn(),
    disarmed: vi.fn(),
    intended: vi.fn(),
    delayKnown: vi.fn(),
    send: (message: ClientMessage) => void this.sent.push(message),
  } satisfies DrivingEvents;
  readonly driving: Driving;

  constructor() {
    const held = (): boolean => this.held;
    const controls = {
      get deadman() {
        return held();
      },
      hasPadNews: false,
      sample: () => ({
        deadman: this.held,
        held: { pad: null, keys: new Set(this.held ? ["KeyW"] : []), touch: null },
        slowShare: 1,
        signature: String(this.held),
      }),
      release: () => (this.held = false),
    } as unknown as Controls;
    this.driving = new Driving(this.state, controls, this.events);
    for (const message of [welcomeOf("operator"), ROBOT, seatOf("me", "me")])
      applyMessage(this.state, message, 0);
    this.driving.robotChanged(ROBOT, this.now);
    this.hear(feedbackOf(1, { axes: [0] }));
    this.driving.take(this.now);
  }

  hear(feedback: Feedback): void {
    applyMessage(this.state, feedback, 0);
    this.driving.tookFeedback(feedback, this.now);
  }

  /** Arms; the robot has executed the neutral command. */
  arm(): void {
    this.driving.arm();
    this.tick();
    this.hear(feedbackOf(2, { axes: [0] }));
    this.sent.length = 0;
  }

  tick(afterMs = 100): void {
    this.now += afterMs;
    this.driving.take(this.now, true);
  }

  commands(): unknown[] {
    return this.sent.flatMap((each) => (each.type === "command" ? [each.values] : []));
  }
}

describe("driving", () => {
  let operator: Operator;

  beforeEach(() => {
    vi.useFakeTimers();
    operator = new Operator();
  });

  afterEach(() => {
    operator.driving.close();
    vi.useRealTimers();
  });

  it("sends what is held once it is armed", () => {
    operator.held = true;
    operator.tick();
    expect(operator.commands()).toEqual([]);
    operator.held = false;
    operator.tick();
    operator.arm();
    operator.held = true;
    operator.tick();
    expect(operator.driving.arming.state).toBe("driving");
    expect(operator.commands()).toEqual([[2]]); // the axis' maximum
  });

  it("is not armed where the conditions forbid it, and says why", () => {
    operator.stopped = true;
    operator.driving.arm();
    expect(operator.driving.isArmed()).toBe(false);
    expect(operator.state.log).toHaveLength(1);
    expect(operator.events.armedChanged).toHaveBeenCalledOnce();
  });

  it("rests when the deadman is let go", () => {
    operator.arm();
    operator.held = true;
    operator.tick();
    operator.sent.length = 0;
    operator.held = false;
    operator.tick(10);
    expect(operator.sent.map(({ type }) => type)).toContain("rest");
    expect(operator.events.intended).toHaveBeenLastCalledWith(operator.now, true);
  });

  it("lets nothing leave that moves after it was barred, until the person arms", () => {
    operator.arm();
    operator.held = true;
    operator.tick();
    operator.driving.bar("stop_pressed");
    expect(operator.events.disarmed).toHaveBeenCalledOnce();
    operator.sent.length = 0;
    operator.held = true;
    for (let step = 0; step < 10; step += 1) operator.tick();
    expect(operator.commands()).toEqual([]);
  });

  it("rests before another layer's inputs count, and comes round to the first", () => {
    operator.arm();
    operator.held = true;
    operator.tick();
    operator.sent.length = 0;
    operator.driving.selectLayer();
    operator.tick(10);
    expect(operator.driving.layer).toBe(1);
    expect(operator.sent.map(({ type }) => type)).toContain("rest");
    operator.driving.selectLayer();
    expect(operator.driving.layer).toBe(0);
  });

  it("tells at once when the delay becomes known, and then the cap lets go", () => {
    operator.state.settings.speedCap = true;
    operator.arm();
    operator.tick();
    expect(operator.driving.speedShare).toBeCloseTo(0.2);
    const { driver } = operator.driving;
    if (driver === null) expect.unreachable();
    notePicture(driver.latency, 2, operator.now);
    noteShown(driver.gate, 2);
    operator.tick(10);
    operator.tick(10);
    expect(operator.events.delayKnown).toHaveBeenCalledOnce();
    expect(operator.driving.speedShare).toBe(1);
  });
});
