import { describe, expect, it } from "vitest";
import {
  DEFAULT_FORCE,
  isSameDevice,
  readKeptStick,
  writeKeptStick,
} from "../../src/force_feedback/force_settings";
import { lengthOf, NO_FORCE, ramped, sourceDegrees, stickForce } from "../../src/force_feedback/stick_force";
import { ForceStick, StickUnusable } from "../../src/haptics/force_stick";
import { ForceStickFake, forceStickCollections, type StickFake } from "./fake_stick";

const HOLD = 0.3;
const SETTINGS = { strongest: 0.5, spring: 0.2, damper: 0.1, reversed: false };
const BACK = { right: 0, ahead: -1 };

/** A stick on a clock of its own. */
class Rig {
  now = 1000;
  lost = 0;
  readonly fake: StickFake = new ForceStickFake(() => this.now);

  async open(settings = SETTINGS): Promise<ForceStick> {
    return ForceStick.open(this.fake, settings, () => (this.lost += 1));
  }

  /** Feels for some time, at the page's rate. */
  async feel(stick: ForceStick, force: typeof BACK | null, ms: number, holdSeconds = HOLD): Promise<void> {
    const end = this.now + ms;
    for (; this.now < end; this.now += 50) {
      stick.feel(force === null ? null : { force, holdSeconds }, this.now);
      await settled();
    }
  }
}

/** All writes of one call are through: the fake answers at once. */
async function settled(): Promise<void> {
  for (let turn = 0; turn < 60; turn += 1) await Promise.resolve();
}

describe("a stick that pushes back", () => {
  it("pushes towards the operator when the robot is pushed back, to the right and the left alike", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    await rig.feel(stick, BACK, 500);
    expect(rig.fake.felt().ahead).toBeCloseTo(-0.5, 1);
    expect(rig.fake.felt().right).toBeCloseTo(0, 1);
    await rig.feel(stick, { right: 1, ahead: 0 }, 500);
    expect(rig.fake.felt().right).toBeCloseTo(0.5, 1);
    await rig.feel(stick, { right: -0.5, ahead: 0 }, 500);
    expect(rig.fake.felt().right).toBeCloseTo(-0.25, 1);
    expect(rig.fake.trouble).toEqual([]);
  });

  it("turns the direction round where the owner says so", async () => {
    const rig = new Rig();
    const stick = await rig.open({ ...SETTINGS, reversed: true });
    await rig.feel(stick, BACK, 500);
    expect(rig.fake.felt().ahead).toBeCloseTo(0.5, 1);
  });

  it("pushes no harder than the settings allow, whatever is wanted", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    for (const force of [
      BACK,
      { right: 90, ahead: -400 },
      { right: -1, ahead: 1 },
      { right: 0.7, ahead: 0.7 },
    ])
      for (let ms = 0; ms < 500; ms += 50) {
        await rig.feel(stick, force, 50);
        expect(lengthOf(rig.fake.felt())).toBeLessThanOrEqual(0.503); // a step of the device's magnitude is 1/255
      }
  });

  it("grows over a fifth of a second, and jumps nowhere", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    const sizes: number[] = [];
    for (let step = 0; step < 5; step += 1) {
      await rig.feel(stick, BACK, 50);
      sizes.push(lengthOf(rig.fake.felt()));
    }
    expect(sizes.map((size, at) => size - (sizes[at - 1] ?? 0) <= 0.5 * 0.25 + 0.005)).not.toContain(false);
    expect(sizes.at(-1)).toBeCloseTo(0.5, 1);
  });

  it("springs and damps alike on both axes, each as strongly as its setting", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    await rig.feel(stick, NO_FORCE, 100);
    expect(rig.fake.felt()).toEqual({
      ...{ right: 0, ahead: 0 },
      spring: expect.closeTo(0.2, 1) as number,
      damper: expect.closeTo(0.1, 1) as number,
    });
    stick.settings = { ...SETTINGS, spring: 0, damper: 0.4 };
    await rig.feel(stick, NO_FORCE, 50);
    expect(rig.fake.felt().spring).toBe(0);
    expect(rig.fake.felt().damper).toBeCloseTo(0.4, 1);
  });

  it("goes on while it is renewed, and is free within hold once nobody renews it", async () => {
    for (const hold of [0.1, 0.3, 5]) {
      const rig = new Rig();
      const stick = await rig.open();
      for (let ms = 0; ms < 2000; ms += 50) {
        await rig.feel(stick, BACK, 50, hold);
        expect(lengthOf(rig.fake.felt(rig.now - 1))).toBeGreaterThan(0);
        expect(rig.fake.until - (rig.now - 50)).toBeLessThanOrEqual(1000 * Math.min(hold, 0.25));
      }
      expect(rig.fake.felt(rig.now + 1000 * hold)).toEqual({ right: 0, ahead: 0, spring: 0, damper: 0 });
    }
  });

  it("ends everything at once when nothing may be felt, and starts from nothing again", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    await rig.feel(stick, BACK, 500);
    await rig.feel(stick, null, 50);
    expect(rig.fake.felt(rig.now - 50)).toEqual({ right: 0, ahead: 0, spring: 0, damper: 0 });
    const { length } = rig.fake.sent;
    await rig.feel(stick, null, 500);
    expect(rig.fake.sent.length).toBe(length);
    await rig.feel(stick, BACK, 50);
    expect(lengthOf(rig.fake.felt(rig.now - 50))).toBeLessThan(0.1);
    expect(rig.fake.trouble).toEqual([]);
  });

  it("ends everything even when it is told so in the midst of a write", async () => {
    for (let turns = 0; turns < 12; turns += 1) {
      const rig = new Rig();
      const stick = await rig.open();
      stick.feel({ force: BACK, holdSeconds: HOLD }, rig.now);
      for (let turn = 0; turn < turns; turn += 1) await Promise.resolve();
      stick.feel(null, rig.now);
      await settled();
      expect(rig.fake.felt()).toEqual({ right: 0, ahead: 0, spring: 0, damper: 0 });
      await rig.feel(stick, BACK, 500);
      expect(rig.fake.felt().ahead).toBeCloseTo(-0.5, 1);
      expect(rig.fake.trouble).toEqual([]);
    }
  });

  it("queues nothing when the stick is slow", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    let release = (): void => undefined;
    const take = rig.fake.sendReport.bind(rig.fake);
    let calls = 0;
    rig.fake.sendReport = async (id, data) => {
      calls += 1;
      await new Promise<void>((done) => (release = done));
      await take(id, data);
    };
    for (let step = 0; step < 100; step += 1) stick.feel({ force: BACK, holdSeconds: HOLD }, (rig.now += 50));
    await settled();
    expect(calls).toBe(1);
    stick.feel(null, rig.now);
    for (let turn = 0; turn < 10; turn += 1) {
      release();
      await settled();
    }
    expect(rig.fake.felt()).toEqual({ right: 0, ahead: 0, spring: 0, damper: 0 });
  });

  it("is let go of once it takes no report any more", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    await rig.feel(stick, BACK, 100);
    rig.fake.plugged = false;
    await rig.feel(stick, BACK, 500);
    expect(rig.lost).toBe(1);
  });

  it("closes with all effects stopped, and its memory empty", async () => {
    const rig = new Rig();
    const stick = await rig.open();
    await rig.feel(stick, BACK, 500);
    await stick.close();
    expect(rig.fake.opened).toBe(false);
    expect(rig.fake.sent.slice(-2).map(([, id, bytes]) => [id, ...bytes])).toEqual([
      [12, 3],
      [12, 4],
    ]);
    stick.feel({ force: BACK, holdSeconds: HOLD }, rig.now);
    await settled();
    expect(rig.lost).toBe(0);
  });

  it("is not opened without room, with a pool that its host manages, or without the reports", async () => {
    const opened = async (change: (fake: StickFake) => void): Promise<unknown> => {
      const rig = new Rig();
      change(rig.fake);
      return rig.open().catch((error: unknown) => error);
    };
    expect(await opened((fake) => (fake.room = 0))).toEqual(
      new StickUnusable("it has no room for an effect"),
    );
    expect(await opened((fake) => (fake.managesPool = false))).toBeInstanceOf(StickUnusable);
    expect(await opened((fake) => (fake.plugged = false))).toEqual(new StickUnusable("it does not answer"));
    const bare = new ForceStickFake(() => 0, forceStickCollections().slice(1));
    await expect(ForceStick.open(bare, SETTINGS, () => undefined)).rejects.toThrow(StickUnusable);
    expect(bare.sent).toEqual([]);
  });

  it("pushes without spring and damper where there is room for one effect only", async () => {
    const rig = new Rig();
    rig.fake.room = 1;
    const stick = await rig.open();
    await rig.feel(stick, BACK, 500);
    expect(rig.fake.felt()).toMatchObject({ ahead: expect.closeTo(-0.5, 1) as number, spring: 0, damper: 0 });
    expect(rig.fake.trouble).toEqual([]);
  });
});

describe("the force on the hand", () => {
  it("has the direction of the force on the robot, and the strength of its rumble", () => {
    expect(stickForce([-30, 0, 0], 0.5)).toEqual({ right: -0, ahead: -0.5 });
    expect(stickForce([0, -30, 0], 1)).toEqual({ right: 1, ahead: 0 });
    expect(lengthOf(stickForce([3, 4, 12], 1))).toBeCloseTo(5 / 13);
  });

  it("is none without a measurement, below the threshold, or of what is no number", () => {
    for (const wrench of [[], [NaN, 0, 0], [Infinity, 1, 0], [0, 0, 0]])
      expect(stickForce(wrench, 1)).toEqual(NO_FORCE);
    expect(stickForce([30, 0, 0], 0)).toEqual(NO_FORCE);
    expect(stickForce([30, 0, 0], NaN)).toEqual(NO_FORCE);
  });

  it("comes from where PID says it does", () => {
    expect(sourceDegrees({ right: 0, ahead: -1 })).toBe(0);
    expect(sourceDegrees({ right: -1, ahead: 0 })).toBe(90);
    expect(sourceDegrees({ right: 0, ahead: 1 })).toBe(180);
    expect(sourceDegrees({ right: 1, ahead: 0 })).toBe(270);
  });

  it("falls faster than it grows", () => {
    expect(ramped(NO_FORCE, BACK, 0.1, 0.5)).toEqual({ right: 0, ahead: -0.1 });
    expect(ramped(BACK, NO_FORCE, 0.1, 0.5)).toEqual({ right: 0, ahead: -0.5 });
    expect(ramped(BACK, NO_FORCE, 0.1, 2)).toEqual(NO_FORCE);
  });
});

describe("what is kept of a stick", () => {
  it("is read as it was written", () => {
    const kept = { stick: { vendorId: 0x045e, productId: 0x001b }, settings: SETTINGS };
    expect(readKeptStick(writeKeptStick(kept))).toEqual(kept);
  });

  it("is the defaults, which are small, where it is missing or spoiled, and never beyond its bounds", () => {
    const none = { stick: null, settings: DEFAULT_FORCE };
    for (const text of [
      null,
      "",
      "[]",
      "{",
      "null",
      '{"stick":{"vendorId":-1,"productId":2}}',
      "x".repeat(2000),
    ])
      expect(readKeptStick(text)).toEqual(none);
    const wild = readKeptStick('{"settings":{"strongest":99,"spring":-1,"damper":"1","reversed":1}}');
    expect(wild.settings).toEqual({ strongest: 1, spring: 0, damper: DEFAULT_FORCE.damper, reversed: false });
  });

  it("is the same device as a pad of its numbers", () => {
    const stick = { vendorId: 0x045e, productId: 0x001b };
    expect(isSameDevice("SideWinder (Vendor: 045e Product: 001b)", stick)).toBe(true);
    expect(isSameDevice("Pad (STANDARD GAMEPAD Vendor: 045E Product: 001B)", stick)).toBe(true);
    expect(isSameDevice("SideWinder (Vendor: 045e Product: 028e)", stick)).toBe(false);
    expect(isSameDevice("A pad", stick)).toBe(false);
  });
});
