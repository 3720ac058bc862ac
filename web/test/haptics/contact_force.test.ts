import { describe, expect, it } from "vitest";
import { contactStrength, feelingOf, forceOf } from "../../src/haptics/contact_force";
import {
  clearTrace,
  createForceTrace,
  noteForce,
  TRACE_EVENTS,
  tracePath,
} from "../../src/haptics/force_trace";
import { createRumblePlan, planRumble, stopRumble, type RumbleOrder } from "../../src/haptics/rumble_plan";
import type { RobotDescription } from "../../src/protocol/wire";

const feeling = { threshold_newtons: 5, full_newtons: 105, curve: 1 };
const wrench = { name: "w", body: "b", threshold_force: 2, full_scale_force: 40, full_scale_torque: 1 };

it("the force is the length of the first three values", () => {
  expect(forceOf([3, 4, 12, 99])).toBe(13);
  expect(forceOf([])).toBe(0);
});

describe("a contact", () => {
  it("is felt from the threshold to full scale", () => {
    expect([0, 5, 55, 105, 500].map((force) => contactStrength(force, feeling))).toEqual([0, 0, 0.5, 1, 1]);
  });

  it("is felt more when it is light and the curve is below 1", () => {
    expect(contactStrength(30, { ...feeling, curve: 0.5 })).toBeCloseTo(0.5);
    expect(contactStrength(55, { ...feeling, curve: 2 })).toBeCloseTo(0.25);
    expect(contactStrength(105, { ...feeling, curve: 0.5 })).toBe(1);
  });

  it("is not felt of a force that is not a number, or without a range", () => {
    expect(contactStrength(NaN, feeling)).toBe(0);
    expect(contactStrength(9, { ...feeling, full_newtons: 5 })).toBe(0);
    expect(contactStrength(55, { ...feeling, curve: 0 })).toBe(0.5);
  });

  it("feels as the description says, else by the sensor's range, and not at all without a sensor", () => {
    const robot = (parts: Partial<RobotDescription>): RobotDescription => parts as RobotDescription;
    expect(feelingOf(robot({ wrench, force_feeling: feeling }))).toEqual(feeling);
    expect(feelingOf(robot({ wrench, force_feeling: null }))).toEqual({
      threshold_newtons: 2,
      full_newtons: 40,
      curve: 1,
    });
    expect(feelingOf(robot({ wrench: null, force_feeling: feeling }))).toBeNull();
  });
});

describe("rumble", () => {
  const strengthOf = (order: RumbleOrder): number =>
    order.kind === "play" ? order.effect.strongMagnitude : -1;

  it("begins with a knock at once, however light the touch", () => {
    const order = planRumble(createRumblePlan(), 0.01, 0);
    expect(order).toMatchObject({ kind: "play", effect: { strongMagnitude: 0.55, leftTrigger: 0.01 } });
  });

  it("is told again before it ends, and at once when it jumps", () => {
    const plan = createRumblePlan();
    planRumble(plan, 0.5, 0);
    expect(planRumble(plan, 0.52, 50).kind).toBe("keep");
    expect(planRumble(plan, 0.8, 60)).toMatchObject({ kind: "play", effect: { strongMagnitude: 0.8 } });
    expect(planRumble(plan, 0.8, 120).kind).toBe("keep");
    const again = planRumble(plan, 0.8, 150);
    expect(again.kind === "play" && again.effect.duration).toBeGreaterThan(90);
  });

  it("is never stronger than 1, and never ends later than an effect lasts", () => {
    const order = planRumble(createRumblePlan(), 1, 0);
    expect(order).toMatchObject({ effect: { strongMagnitude: 1, weakMagnitude: 1, rightTrigger: 1 } });
    expect(order.kind === "play" && order.effect.duration).toBeLessThanOrEqual(200);
  });

  it("is stopped once, when the contact ends or nothing may be felt", () => {
    const plan = createRumblePlan();
    expect([planRumble(plan, 0, 0).kind, stopRumble(plan).kind]).toEqual(["keep", "keep"]);
    planRumble(plan, 0.4, 10);
    expect([planRumble(plan, 0, 20).kind, planRumble(plan, NaN, 30).kind]).toEqual(["stop", "keep"]);
    expect(strengthOf(planRumble(plan, 0.2, 40))).toBe(0.55);
    expect([stopRumble(plan).kind, stopRumble(plan).kind]).toEqual(["stop", "keep"]);
  });
});

describe("the force trace", () => {
  it("keeps the strongest force of each event, and so many events", () => {
    const trace = createForceTrace();
    for (let event = 1; event <= TRACE_EVENTS + 5; event++) noteForce(trace, event, event);
    noteForce(trace, TRACE_EVENTS + 5, 3);
    noteForce(trace, TRACE_EVENTS + 5, 999);
    expect(trace.points).toHaveLength(TRACE_EVENTS);
    expect(trace.points.at(0)).toEqual({ event: 6, force: 6 });
    expect(trace.points.at(-1)).toEqual({ event: TRACE_EVENTS + 5, force: 999 });
  });

  it("begins anew with another run of the robot", () => {
    const trace = createForceTrace();
    noteForce(trace, 500, 1);
    noteForce(trace, 1, 2);
    expect(trace.points).toEqual([{ event: 1, force: 2 }]);
    clearTrace(trace);
    expect(tracePath(trace, 10, 100, 20)).toBe("");
  });

  it("is drawn with the newest event at the right, within its box", () => {
    const trace = createForceTrace();
    noteForce(trace, 1, 5);
    noteForce(trace, 2, 50);
    noteForce(trace, 3, NaN);
    expect(tracePath(trace, 10, 119, 20)).toBe("M117.0 20L117.0 10.0L118.0 0.0L119.0 20.0L119 20Z");
    expect(tracePath(trace, 0, 119, 20)).toBe("");
  });
});
