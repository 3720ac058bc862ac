import { describe, expect, it } from "vitest";
import {
  createHeadsetInput,
  grab,
  isSilent,
  letGo,
  SILENT_MS,
  takeFrame,
  type HandSample,
  type HeadsetEvent,
  type HeadsetInput,
} from "../../src/xr/headset_input";
import { about } from "../../src/util/rigid";

const FRAME_MS = 14;
const PLACE = { position: [0.2, 1.2, -0.4], orientation: [0, 0, 0, 1] } as const;

function hand(parts: Partial<HandSample> = {}): HandSample {
  return {
    ...{ side: "right", pose: PLACE, squeeze: 0, trigger: 0, stick: [0, 0] },
    ...{ stop: false, layer: false, recentre: false },
    ...parts,
  };
}

/** A session whose shell arms at once, as often as it is asked to. */
class Session {
  readonly input: HeadsetInput = createHeadsetInput();
  now = 1000;

  frame(...samples: readonly HandSample[]): HeadsetEvent[] {
    this.now += FRAME_MS;
    const events = takeFrame(this.input, samples, this.now);
    for (const event of events) if (event.kind === "arm") grab(this.input, event.side);
    return events;
  }

  squeezed(): this {
    this.frame(hand());
    this.frame(hand({ squeeze: 1 }));
    return this;
  }
}

describe("a squeeze", () => {
  it("asks to arm once, and only from a hand that was seen open", () => {
    const session = new Session();
    expect(session.frame(hand({ squeeze: 1 }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 1 }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 0.1 }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 0.7 }))).toEqual([{ kind: "arm", side: "right" }]);
    expect(session.frame(hand({ squeeze: 1 }))).toEqual([]);
    expect([...session.input.held]).toEqual(["right"]);
  });

  it("ends when the hand lets go, with room for a finger that trembles", () => {
    const session = new Session().squeezed();
    expect(session.frame(hand({ squeeze: 0.5 }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 0.3 }))).toEqual([{ kind: "lost", why: "squeeze_released" }]);
    expect(session.input.held.size).toBe(0);
  });

  it("that was refused arms nothing until the hand has opened", () => {
    const input = createHeadsetInput();
    takeFrame(input, [hand()], 0);
    expect(takeFrame(input, [hand({ squeeze: 1 })], 14)).toEqual([{ kind: "arm", side: "right" }]);
    expect(takeFrame(input, [hand({ squeeze: 1 })], 28)).toEqual([]);
    expect(input.held.size).toBe(0);
  });

  it("that the page let go of needs a new one", () => {
    const session = new Session().squeezed();
    letGo(session.input);
    expect(session.frame(hand({ squeeze: 1 }))).toEqual([]);
    expect(session.input.held.size).toBe(0);
  });

  it("of one hand goes on when the other lets go", () => {
    const session = new Session();
    session.frame(hand(), hand({ side: "left" }));
    session.frame(hand({ squeeze: 1 }), hand({ side: "left", squeeze: 1 }));
    expect(session.frame(hand(), hand({ side: "left", squeeze: 1 }))).toEqual([]);
    expect([...session.input.held]).toEqual(["left"]);
  });
});

describe("a hand that holds the deadman is lost", () => {
  it("when it is not tracked, or only guessed", () => {
    const session = new Session().squeezed();
    expect(session.frame(hand({ squeeze: 1, pose: null }))).toEqual([{ kind: "lost", why: "tracking_lost" }]);
    expect(session.frame(hand({ squeeze: 1 }))).toEqual([]);
    expect(session.input.held.size).toBe(0);
  });

  it("when its controller is gone, and what it held when it comes back counts for nothing", () => {
    const session = new Session().squeezed();
    expect(session.frame()).toEqual([{ kind: "lost", why: "tracking_lost" }]);
    expect(session.frame(hand({ squeeze: 1 }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 1 }))).toEqual([]);
  });

  it("when it comes out elsewhere than it can have moved", () => {
    const session = new Session().squeezed();
    const near = { ...PLACE, position: [0.25, 1.2, -0.4] } as const;
    const far = { ...PLACE, position: [0.9, 1.2, -0.4] } as const;
    expect(session.frame(hand({ squeeze: 1, pose: near }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 1, pose: far }))).toEqual([{ kind: "lost", why: "tracking_lost" }]);
  });

  const turned = (angle: number) => ({ ...PLACE, orientation: about([0.6, 0, 0.8], angle) }) as const;

  it("when it comes out turned further than a wrist can have turned", () => {
    const session = new Session().squeezed();
    expect(session.frame(hand({ squeeze: 1, pose: turned(0.3) }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 1, pose: turned(0.6) }))).toEqual([]);
    expect(session.frame(hand({ squeeze: 1, pose: turned(2.2) }))).toEqual([
      { kind: "lost", why: "tracking_lost" },
    ]);
  });

  it("when it comes out the other way round, however long the frame took", () => {
    const session = new Session().squeezed();
    session.now += 200;
    expect(session.frame(hand({ squeeze: 1, pose: turned(1.5) }))).toEqual([]);
    session.now += 200;
    expect(session.frame(hand({ squeeze: 1, pose: turned(1.5 + Math.PI) }))).toEqual([
      { kind: "lost", why: "tracking_lost" },
    ]);
  });

  it("but not when the same orientation is told by the other quaternion", () => {
    const session = new Session().squeezed();
    const { orientation } = PLACE;
    const [x, y, z, w] = orientation;
    const other = { ...PLACE, orientation: [-x, -y, -z, -w] } as const;
    expect(session.frame(hand({ squeeze: 1, pose: other }))).toEqual([]);
  });

  it("and ends driving with both", () => {
    const session = new Session();
    session.frame(hand(), hand({ side: "left" }));
    session.frame(hand({ squeeze: 1 }), hand({ side: "left", squeeze: 1 }));
    session.frame(hand({ squeeze: 1, pose: null }), hand({ side: "left", squeeze: 1 }));
    expect(session.input.held.size).toBe(0);
  });
});

describe("a hand that comes", () => {
  it("with STOP pressed says it, and once: it may have been lost when it was pressed", () => {
    const session = new Session();
    session.frame(hand());
    session.frame();
    expect(session.frame(hand({ stop: true, layer: true }))).toEqual([{ kind: "stop" }]);
    expect(session.frame(hand({ stop: true, layer: true }))).toEqual([]);
  });
});

describe("the session's frames", () => {
  it("are missed after a while", () => {
    const session = new Session().squeezed();
    expect(isSilent(session.input, session.now + SILENT_MS)).toBe(false);
    expect(isSilent(session.input, session.now + SILENT_MS + 1)).toBe(true);
  });
});

describe("buttons", () => {
  it("are told once when they are pressed, and not when they were held from the start", () => {
    const session = new Session();
    expect(session.frame(hand({ layer: true, recentre: true, trigger: 1 }))).toEqual([]);
    session.frame(hand());
    const pressed = session.frame(hand({ stop: true, layer: true, recentre: true, trigger: 1 }));
    expect(pressed.map(({ kind }) => kind)).toEqual(["stop", "layer", "recentre", "press"]);
    expect(session.frame(hand({ stop: true, layer: true, recentre: true, trigger: 1 }))).toEqual([]);
  });

  it("of the view are pressed by a hand that drives for STOP alone: its trigger is the gripper's", () => {
    const session = new Session();
    const left = (trigger: number): HandSample => hand({ side: "left", trigger });
    const presses = (...samples: readonly HandSample[]): HeadsetEvent[] =>
      session.frame(...samples).filter(({ kind }) => kind === "press");
    session.frame(hand(), left(0));
    // One that begins to drive in this very frame does so too.
    expect(presses(hand({ squeeze: 1, trigger: 1 }), left(0))).toEqual([
      { kind: "press", side: "right", drives: true },
    ]);
    presses(hand({ squeeze: 1 }), left(0));
    expect(presses(hand({ squeeze: 1, trigger: 1 }), left(1))).toEqual([
      { kind: "press", side: "right", drives: true },
      { kind: "press", side: "left", drives: false },
    ]);
    presses(hand({ squeeze: 1 }), left(0));
    expect(presses(hand({ trigger: 1 }), left(0))).toEqual([{ kind: "press", side: "right", drives: true }]); // lets go
    presses(hand(), left(0));
    expect(presses(hand({ trigger: 1 }), left(0))).toEqual([{ kind: "press", side: "right", drives: false }]);
  });

  it("are pressed by a hand that drives until this frame for STOP alone, where the other hand is lost in it", () => {
    const session = new Session();
    const left = (pose: HandSample["pose"]): HandSample => hand({ side: "left", squeeze: 1, pose });
    session.frame(hand({ side: "left" }), hand());
    session.frame(left(PLACE), hand({ squeeze: 1 }));
    expect(session.frame(left(null), hand({ squeeze: 1, trigger: 1 }))).toEqual([
      { kind: "lost", why: "tracking_lost" },
      { kind: "press", side: "right", drives: true },
    ]);
  });

  it("stop the robot from a hand that is not tracked too", () => {
    const session = new Session();
    session.frame(hand({ pose: null }));
    expect(session.frame(hand({ pose: null, stop: true }))).toEqual([{ kind: "stop" }]);
  });
});

describe("sticks and triggers", () => {
  it("are the two halves of a gamepad", () => {
    const session = new Session();
    session.frame(hand({ side: "left", stick: [0, -1], trigger: 1 }), hand({ stick: [1, 0] }));
    const { left_x, left_y, right_x, right_y, triggers } = session.input.inputs;
    expect([left_x, left_y, right_x, right_y, triggers].map((value) => value + 0)).toEqual([0, -1, 1, 0, -1]);
  });

  it("that are not numbers move nothing", () => {
    const session = new Session();
    session.frame(hand({ stick: [NaN, NaN], trigger: NaN }));
    expect(Object.values(session.input.inputs)).toEqual([0, 0, 0, 0, 0, 0, 0]);
  });
});
