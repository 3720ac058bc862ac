import { describe, expect, it } from "vitest";
import {
  arm,
  createArming,
  disarm,
  lostCondition,
  sampleDeadman,
  type ArmConditions,
  type Arming,
} from "../../src/drive/arming";

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

function armed(): Arming {
  const arming = createArming();
  sampleDeadman(arming, false, "", 0);
  expect(arm(arming, READY, false)).toBeNull();
  return arming;
}

describe("arming", () => {
  it("needs the deadman seen released first", () => {
    const arming = createArming();
    expect(arm(arming, READY, false)).toBe("deadman_held");
    sampleDeadman(arming, true, "", 0);
    expect(arm(arming, READY, false)).toBe("deadman_held");
    sampleDeadman(arming, false, "", 1);
    expect(arm(arming, READY, false)).toBeNull();
    expect(arming.state).toBe("armed");
  });

  it.each([
    ["observer", { operator: false }],
    ["not_connected", { connected: false }],
    ["robot_down", { robotUp: false }],
    ["no_seat", { holdsSeat: false }],
    ["stopped", { stopped: true }],
    ["stop_pressed", { stopPressed: true }],
    ["stopped", { stopped: true, stopPressed: true }],
    ["hidden", { visible: false }],
    ["occupied", { occupied: true }],
  ] as const)("is refused: %s", (refusal, change) => {
    const arming = createArming();
    sampleDeadman(arming, false, "", 0);
    expect(arm(arming, { ...READY, ...change }, false)).toBe(refusal);
    expect(arming.state).toBe("disarmed");
  });

  it("does not arm with a deadman that was pressed since the last sample", () => {
    const arming = createArming();
    sampleDeadman(arming, false, "", 0);
    expect(arm(arming, READY, true)).toBe("deadman_held");
    expect(arm(arming, READY, false)).toBeNull();
  });

  it("again while armed changes nothing", () => {
    const arming = armed();
    sampleDeadman(arming, true, "a", 1);
    expect(arm(arming, READY, false)).toBeNull();
    expect(arming.state).toBe("driving");
  });
});

describe("the deadman", () => {
  it("drives while it is held, and says when it is let go", () => {
    const arming = armed();
    expect(sampleDeadman(arming, true, "a", 1)).toBeNull();
    expect(arming.state).toBe("driving");
    expect(sampleDeadman(arming, false, "", 2)).toBe("released");
    expect(arming.state).toBe("armed");
    expect(sampleDeadman(arming, false, "", 3)).toBeNull();
  });

  it("drives nothing while disarmed", () => {
    const arming = createArming();
    sampleDeadman(arming, true, "a", 0);
    expect(arming.state).toBe("disarmed");
    expect(sampleDeadman(arming, false, "", 1)).toBeNull();
  });

  it("held a minute with nothing else changing counts as taped down", () => {
    const arming = armed();
    sampleDeadman(arming, true, "a", 1000);
    expect(sampleDeadman(arming, true, "a", 60_999)).toBeNull();
    expect(sampleDeadman(arming, true, "a", 61_000)).toBe("taped_down");
    expect(arming).toMatchObject({ state: "disarmed", reason: "taped_down" });
  });

  it("held with changing input is not taped down", () => {
    const arming = armed();
    sampleDeadman(arming, true, "a", 0);
    sampleDeadman(arming, true, "b", 59_000);
    expect(sampleDeadman(arming, true, "b", 118_000)).toBeNull();
    expect(sampleDeadman(arming, true, "b", 119_000)).toBe("taped_down");
  });

  it("a new hold starts the minute anew", () => {
    const arming = armed();
    sampleDeadman(arming, true, "a", 0);
    sampleDeadman(arming, false, "a", 30_000);
    sampleDeadman(arming, true, "a", 31_000);
    expect(sampleDeadman(arming, true, "a", 90_000)).toBeNull();
  });
});

describe("disarming", () => {
  it("says whether it was armed and keeps the reason", () => {
    const arming = armed();
    expect(disarm(arming, "blur")).toBe(true);
    expect(arming.reason).toBe("blur");
    expect(disarm(arming, "hidden")).toBe(false);
    expect(arming.reason).toBe("blur");
  });

  it.each([
    ["connection_lost", { connected: false }],
    ["stopped", { stopped: true }],
    ["stop_pressed", { stopPressed: true }],
    ["robot_down", { robotUp: false }],
    ["seat_lost", { holdsSeat: false }],
    ["seat_lost", { operator: false }],
    ["hidden", { visible: false }],
    [null, {}],
  ] as const)("%s follows from the conditions", (reason, change) => {
    expect(lostCondition({ ...READY, ...change })).toBe(reason);
  });
});
