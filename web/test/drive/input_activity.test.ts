import { describe, expect, it } from "vitest";
import { arm, createArming, sampleDeadman, type ArmConditions } from "../../src/drive/arming";
import { createInputActivity, noteInput } from "../../src/drive/input_activity";
import { STANDARD_LAYOUT } from "../../src/gamepad/layout";
import { readPad, type PadInputs } from "../../src/gamepad/mapping";
import { DEFAULT_SHAPING } from "../../src/gamepad/stick_shape";
import type { HeldInputs } from "../../src/drive/axis_mapping";

const READY: ArmConditions = {
  operator: true,
  connected: true,
  robotUp: true,
  holdsSeat: true,
  lockedOut: false,
  stopped: false,
  stopPressed: false,
  visible: true,
  occupied: false,
};
const TICK_MS = 10;
const MINUTE_MS = 60_000;

function pad(leftY: number): PadInputs {
  const buttons = Array.from({ length: 17 }, (_, index) => ({
    pressed: index === 5,
    value: Number(index === 5),
  }));
  const snapshot = { id: "pad", mapping: "standard", axes: [0, leftY, 0, 0], buttons };
  return readPad(snapshot, STANDARD_LAYOUT, DEFAULT_SHAPING, new Set()).inputs;
}

const holding: Record<string, (now: number) => HeldInputs> = {
  "a pad whose sensors tremble": (now) => ({
    pad: pad(-0.6 + 0.008 * Math.sin(now)),
    keys: new Set(),
    touch: null,
  }),
  "a pad at its stop": () => ({ pad: pad(-1), keys: new Set(), touch: null }),
  "the keyboard": () => ({ pad: null, keys: new Set(["Space", "KeyW"]), touch: null }),
  "a touched stick": (now) => ({
    pad: null,
    keys: new Set(),
    touch: { left_x: 0, left_y: 0.7 + 0.005 * Math.cos(now), right_x: 0, right_y: 0 },
  }),
};

/** Holds it and says when it disarmed as taped down; null when it did not within `forMs`. */
function tapedAfter(held: (now: number) => HeldInputs, forMs: number): number | null {
  const arming = createArming();
  const activity = createInputActivity();
  sampleDeadman(arming, false, "", 0);
  expect(arm(arming, READY, false)).toBeNull();
  for (let now = 0; now <= forMs; now += TICK_MS)
    if (sampleDeadman(arming, true, noteInput(activity, held(now)), now) === "taped_down") {
      expect([arming.state, arming.reason]).toEqual(["disarmed", "taped_down"]);
      return now;
    }
  return null;
}

describe("a deadman that is taped down", () => {
  it("disarms after a minute, on pad, keyboard and touch", () => {
    for (const [name, held] of Object.entries(holding))
      expect([name, tapedAfter(held, 2 * MINUTE_MS)]).toEqual([name, MINUTE_MS]);
  });

  it("is not one whose stick a hand moves", () => {
    const moved = (now: number): HeldInputs => ({
      pad: pad(-0.6 + 0.1 * Math.sin(now / 2000)),
      keys: new Set(),
      touch: null,
    });
    expect(tapedAfter(moved, 2 * MINUTE_MS)).toBeNull();
  });

  it("is not one whose slider is moved a little now and then", () => {
    const dragged = (now: number): HeldInputs => ({
      pad: null,
      keys: new Set(),
      touch: null,
      sliders: { travels: { elbow: 0.001 * Math.floor(now / 20_000) }, pushes: {} },
    });
    expect(tapedAfter(dragged, 2 * MINUTE_MS)).toBeNull();
    expect(tapedAfter(() => dragged(0), 2 * MINUTE_MS)).toBe(MINUTE_MS);
  });

  it("is not one with another key from time to time", () => {
    const typed = (now: number): HeldInputs => ({
      pad: null,
      keys: new Set(now % 30_000 < 1000 ? ["Space", "KeyW"] : ["Space"]),
      touch: null,
    });
    expect(tapedAfter(typed, 2 * MINUTE_MS)).toBeNull();
  });
});
