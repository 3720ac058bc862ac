import { describe, expect, it } from "vitest";
import { LONG_PRESS_MS, MapGestures, type Gesture } from "../../src/map/map_gestures";

const goals = (gestures: readonly Gesture[]): Gesture[] => gestures.filter((each) => each.kind === "goal");

describe("a hand on the map", () => {
  it("sets a goal by a click, without a heading", () => {
    const hand = new MapGestures();
    hand.down(1, "mouse", true, [10, 20], 0);
    expect(goals(hand.up(1, [12, 21]))).toEqual([{ kind: "goal", at: [10, 20], towards: null }]);
  });

  it("says the heading by a drag", () => {
    const hand = new MapGestures();
    hand.down(1, "mouse", true, [10, 20], 0);
    expect(hand.move(1, [60, 20])).toEqual([{ kind: "aim", at: [10, 20], towards: [60, 20] }]);
    expect(goals(hand.up(1, [60, 20]))).toEqual([{ kind: "goal", at: [10, 20], towards: [60, 20] }]);
  });

  it("moves the map by another button, and for a person who may not drive", () => {
    const hand = new MapGestures();
    expect(hand.down(1, "mouse", false, [10, 20], 0)).toEqual([]);
    expect(hand.move(1, [15, 18])).toEqual([{ kind: "pan", dx: 5, dy: -2 }]);
    expect(hand.up(1, [15, 18])).toEqual([]);
    hand.down(2, "touch", false, [10, 20], 0);
    expect(hand.look(LONG_PRESS_MS)).toEqual([]);
    expect(hand.up(2, [10, 20])).toEqual([]);
  });

  it("takes a finger that rests for a goal, and one that wanders or taps for none", () => {
    const rests = new MapGestures();
    rests.down(1, "touch", true, [10, 20], 0);
    expect(rests.look(LONG_PRESS_MS - 1)).toEqual([]);
    expect(rests.look(LONG_PRESS_MS)).toEqual([{ kind: "aim", at: [10, 20], towards: null }]);
    expect(goals(rests.up(1, [10, 60]))).toEqual([{ kind: "goal", at: [10, 20], towards: [10, 60] }]);

    const taps = new MapGestures();
    taps.down(1, "touch", true, [10, 20], 0);
    expect(taps.up(1, [10, 20])).toEqual([]);

    const wanders = new MapGestures();
    wanders.down(1, "touch", true, [10, 20], 0);
    expect(wanders.move(1, [30, 20])).toEqual([{ kind: "pan", dx: 20, dy: 0 }]);
    expect(wanders.look(LONG_PRESS_MS * 2)).toEqual([]);
    expect(wanders.up(1, [30, 20])).toEqual([]);
  });

  it("sets no goal once a second finger came, or the pointer was lost", () => {
    const hand = new MapGestures();
    hand.down(1, "touch", true, [0, 0], 0);
    hand.look(LONG_PRESS_MS);
    expect(hand.down(2, "touch", true, [100, 0], 600)).toEqual([{ kind: "none" }]);
    expect(hand.up(1, [0, 0])).toEqual([]);
    expect(hand.up(2, [100, 0])).toEqual([]);
    hand.down(3, "mouse", true, [0, 0], 0);
    expect(hand.cancel()).toEqual([{ kind: "none" }]);
    expect(hand.up(3, [0, 0])).toEqual([]);
  });

  it("zooms by two fingers", () => {
    const hand = new MapGestures();
    hand.down(1, "touch", true, [0, 0], 0);
    hand.down(2, "touch", true, [100, 0], 10);
    expect(hand.move(2, [200, 0])).toEqual([
      { kind: "pan", dx: 50, dy: 0 },
      { kind: "zoom", at: [100, 0], factor: 2 },
    ]);
  });

  it("ignores pointers that it does not know", () => {
    const hand = new MapGestures();
    expect(hand.move(9, [1, 1])).toEqual([]);
    expect(hand.up(9, [1, 1])).toEqual([]);
    expect(hand.look(1e9)).toEqual([]);
  });
});
