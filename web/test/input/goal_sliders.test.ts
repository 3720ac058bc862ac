import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { GoalSliders } from "../../src/input/goal_sliders";

/** The events and the width of an element, without a page. */
class Track extends EventTarget {
  width = 400; // CSS pixels
  readonly classList = { add: () => undefined, remove: () => undefined };
  setPointerCapture = (): void => undefined;
  getBoundingClientRect = (): { width: number } => ({ width: this.width });
}

class Pointer extends Event {
  readonly button = 0;
  constructor(
    type: string,
    readonly pointerId: number,
    readonly clientX: number,
  ) {
    super(type);
  }
}

describe("a slider that is dragged", () => {
  beforeEach(() => {
    vi.stubGlobal("PointerEvent", Pointer);
    vi.stubGlobal("document", { activeElement: null });
  });
  afterEach(() => vi.unstubAllGlobals());

  function held(): { sliders: GoalSliders; track: Track; travel: () => number | undefined } {
    const sliders = new GoalSliders();
    const track = new Track();
    sliders.add("elbow", track as unknown as HTMLElement);
    track.dispatchEvent(new Pointer("pointerdown", 1, 100));
    track.dispatchEvent(new Pointer("pointermove", 1, 140));
    return { sliders, track, travel: () => sliders.sample(new Set()).travels["elbow"] };
  }

  it("moves by what the pointer moves, and nothing when the page is laid out anew", () => {
    const { track, travel } = held();
    expect(travel()).toBe(0.1);
    track.width = 100;
    expect(travel()).toBe(0.1);
  });

  it("takes no second finger, and is let go by a cancel of its own pointer alone", () => {
    const { sliders, track, travel } = held();
    track.dispatchEvent(new Pointer("pointerdown", 2, 300));
    track.dispatchEvent(new Pointer("pointermove", 2, 380));
    track.dispatchEvent(new Pointer("pointercancel", 2, 380));
    expect(travel()).toBe(0.1);
    expect(sliders.deadman).toBe(true);
    track.dispatchEvent(new Pointer("pointercancel", 1, 140));
    expect(travel()).toBeUndefined();
    expect(sliders.deadman).toBe(false);
  });
});
