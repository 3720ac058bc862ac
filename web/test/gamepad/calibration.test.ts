import { describe, expect, it } from "vitest";
import {
  CALIBRATION_STEPS,
  createCalibration,
  currentStep,
  goBack,
  layoutOf,
  observe,
  skip,
  type Calibration,
} from "../../src/gamepad/calibration";
import { calibrationPrompt } from "../../src/gamepad/labels";
import { padOf } from "./pads";

/** A pad in somebody's hand. Axes 2 and 5 are triggers, axis 6 is a hat. */
class Hand {
  readonly calibration: Calibration = createCalibration();
  axes: number[];
  private now = 0;

  constructor(axes = [0, 0, -1, 0, 0, -1, 23 / 7]) {
    this.axes = axes;
  }

  /** Holds what is held for that long. */
  hold(pressed: number[] = [], ms = 300): this {
    for (const end = this.now + ms; this.now < end; this.now += 20)
      observe(this.calibration, padOf(this.axes, pressed, ""), this.now);
    return this;
  }

  press(index: number): this {
    return this.hold().hold([index], 100).hold();
  }

  /** Moves an axis to these places, and leaves it at the last. */
  move(index: number, ...places: number[]): this {
    this.hold();
    for (const place of places) {
      this.axes[index] = place;
      this.hold([], 40);
    }
    return this.hold();
  }

  get asked(): string | undefined {
    return currentStep(this.calibration)?.name;
  }

  given(name: Parameters<Calibration["answers"]["get"]>[0]): unknown {
    return this.calibration.answers.get(name);
  }

  /** Through the questions before this one. */
  to(name: string): this {
    this.press(5).press(9).press(1);
    this.move(0, 1, -1, 0).move(1, -1, 1, 0);
    for (let left = 20; left > 0 && this.asked !== name; left--) skip(this.calibration);
    expect(this.asked).toBe(name);
    return this;
  }
}

describe("calibration", () => {
  it("asks first for what moves and what stops the robot", () => {
    expect(CALIBRATION_STEPS.filter(({ required }) => required).map(({ name }) => name)).toEqual([
      "deadman",
      "arm",
      "stop",
      "left_x",
      "left_y",
    ]);
  });

  it("asks nothing while something is held", () => {
    const hand = new Hand().hold([3], 100);
    expect(hand.calibration.phase).toBe("letting_go");
    hand.axes[0] = 0.5;
    hand.hold([], 60);
    expect(hand.calibration.phase).toBe("letting_go");
    expect(hand.hold().calibration.phase).toBe("asking");
  });

  it("takes a button when it is let go", () => {
    const hand = new Hand().hold().hold([5], 2000);
    expect(hand.asked).toBe("deadman");
    hand.hold();
    expect(hand.given("deadman")).toEqual({ kind: "button", index: 5 });
    expect(hand.asked).toBe("arm");
  });

  it("does not count a button that the pad reports as pressed all the time", () => {
    const hand = new Hand().hold([11]).hold([5, 11], 100).hold([11]);
    expect(hand.given("deadman")).toEqual({ kind: "button", index: 5 });
  });

  it("refuses a button that already does something else", () => {
    const hand = new Hand().press(5).press(5);
    expect(hand.asked).toBe("arm");
    expect(calibrationPrompt(hand.calibration).trouble).toContain("Hold to move");
    hand.press(9);
    expect([hand.asked, calibrationPrompt(hand.calibration).trouble]).toEqual(["stop", ""]);
  });

  it("takes no stick for a button", () => {
    const hand = new Hand().move(0, 1, 0);
    expect(hand.asked).toBe("deadman");
  });

  it("takes a stick's travel, and which way is which, from where it goes first", () => {
    const hand = new Hand().to("right_x");
    expect(hand.given("left_x")).toEqual({ index: 0, negative: -1, rest: 0, positive: 1 });
    expect(hand.given("left_y")).toEqual({ index: 1, negative: -1, rest: 0, positive: 1 });
    hand.move(3, -0.9, 0.8, 0.02);
    expect(hand.given("right_x")).toEqual({ index: 3, negative: 0.8, rest: 0, positive: -0.9 });
  });

  it("turns a stick round whose up is positive", () => {
    const hand = new Hand().to("right_y").move(4, 1, -1, 0);
    expect(hand.given("right_y")).toEqual({ index: 4, negative: 1, rest: 0, positive: -1 });
  });

  it("waits for a stick that went to one side only, or is not let go", () => {
    const hand = new Hand().to("right_x").move(3, 1, 0);
    expect(hand.asked).toBe("right_x");
    hand.move(3, -1);
    expect(hand.asked).toBe("right_x");
    expect(hand.move(3, 0).asked).toBe("right_y");
  });

  it("prefers a stick that does nothing yet to one that swings along", () => {
    const hand = new Hand().to("right_x").hold();
    hand.axes[0] = 1;
    hand.move(3, 0.8, -0.8, 0);
    hand.axes[0] = 0;
    hand.hold();
    expect(hand.given("right_x")).toMatchObject({ index: 3 });
  });

  it("does not take the same stick twice", () => {
    const hand = new Hand().to("right_x").move(0, 1, -1, 0);
    expect(hand.asked).toBe("right_x");
    expect(calibrationPrompt(hand.calibration).trouble).toContain("Left stick");
  });

  it("finds a trigger that rests at -1", () => {
    const hand = new Hand().to("right_trigger").move(5, 0.2, 1, -1);
    expect(hand.given("right_trigger")).toEqual({ kind: "axis", index: 5, rest: -1, full: 1 });
  });

  it.each([
    ["at once", [1, -1]],
    ["slowly", [-0.9, 0, 1, -1]],
    ["only a little first", [-0.4, 1, -1]],
  ])("finds a trigger that read 0 until it was pulled %s", (_, places) => {
    const hand = new Hand([0, 0, 0, 0, 0, 0, 23 / 7]).to("right_trigger").move(5, ...places);
    expect(hand.given("right_trigger")).toEqual({ kind: "axis", index: 5, rest: -1, full: 1 });
  });

  it.each([
    ["at rest", -1],
    ["untouched", 0],
  ])("does not take a trigger that was %s while it is held", (_, base) => {
    const hand = new Hand([0, 0, -1, 0, 0, base, 23 / 7]).to("right_trigger").move(5, -0.9, 1).hold([], 2000);
    expect(hand.asked).toBe("right_trigger");
    hand.move(5, -1);
    expect(hand.given("right_trigger")).toEqual({ kind: "axis", index: 5, rest: -1, full: 1 });
  });

  it("prefers the axis of a trigger that is a button as well", () => {
    const hand = new Hand().to("left_trigger").hold();
    hand.axes[2] = 1;
    hand.hold([6], 100);
    hand.axes[2] = -1;
    hand.hold();
    expect(hand.given("left_trigger")).toEqual({ kind: "axis", index: 2, rest: -1, full: 1 });
  });

  it("takes no part that only woke up, like a trigger that falls from 0 to -1 at the first touch", () => {
    const hand = new Hand([0, 0, 0, 0, 0, 0, 23 / 7]).hold();
    hand.axes[2] = -1;
    hand.hold([5], 100).hold();
    expect(hand.given("deadman")).toEqual({ kind: "button", index: 5 });
  });

  it("finds a cross of two axes, and one that is a hat", () => {
    const axes = new Hand().to("cross_up").move(4, -1, 0);
    expect(axes.given("cross_up")).toEqual({ kind: "axis", index: 4, rest: 0, full: -1 });
    const hat = new Hand()
      .to("cross_up")
      .move(6, -1, 23 / 7)
      .move(6, -3 / 7, 23 / 7);
    expect(hat.given("cross_up")).toEqual({ kind: "hat", index: 6, value: -1 });
    expect(hat.given("cross_right")).toEqual({ kind: "hat", index: 6, value: -3 / 7 });
  });

  it("skips only what may be missing", () => {
    const hand = new Hand().hold();
    expect(skip(hand.calibration)).toBe(false);
    expect(hand.to("slow").asked).toBe("slow");
    expect(skip(hand.calibration)).toBe(true);
    expect(hand.given("slow")).toBeNull();
  });

  it("asks again on the way back", () => {
    const hand = new Hand().press(5);
    goBack(hand.calibration);
    expect([hand.asked, hand.given("deadman")]).toEqual(["deadman", undefined]);
    expect(hand.press(7).given("deadman")).toEqual({ kind: "button", index: 7 });
  });

  it("makes a layout of all answers, and none before", () => {
    const hand = new Hand().to("layer").press(3).press(0);
    expect(layoutOf(hand.calibration)).toBeNull();
    hand.press(2).press(11);
    const layout = layoutOf(hand.calibration);
    expect(layout?.actions).toEqual({
      deadman: [{ kind: "button", index: 5 }],
      arm: [{ kind: "button", index: 9 }],
      stop: [{ kind: "button", index: 1 }],
      slow: [],
      turbo: [],
      layer: [{ kind: "button", index: 3 }],
      action_1: [{ kind: "button", index: 0 }],
      action_2: [{ kind: "button", index: 2 }],
      episode: [{ kind: "button", index: 11 }],
    });
    expect(layout?.sticks.left_x).toMatchObject({ index: 0 });
    expect(layout?.triggers).toEqual({ left_trigger: null, right_trigger: null });
    expect([currentStep(hand.calibration), skip(hand.calibration)]).toEqual([null, false]);
    expect(calibrationPrompt(hand.calibration).what).toBe("");
    hand.press(4); // does nothing more
    expect(layoutOf(hand.calibration)).toEqual(layout);
  });

  it("goes on where an axis is not a number", () => {
    const hand = new Hand([0, 0, NaN, 0, 0, -1, 23 / 7]).press(5);
    expect(hand.given("deadman")).toEqual({ kind: "button", index: 5 });
  });
});
