import { beforeEach, describe, expect, it, vi } from "vitest";
import { FORCE_KEY, ForceFeedback, type ForceContext } from "../../src/haptics/force_feedback";
import { lengthOf } from "../../src/force_feedback/stick_force";
import { ForceStickFake, HidFake } from "../force_feedback/fake_stick";

const ID = "Fake force stick (Vendor: 045e Product: 001b)";
const FREE = { right: 0, ahead: 0, spring: 0, damper: 0 };

type Mutable<T> = { -readonly [Name in keyof T]: Mutable<T[Name]> };

/** A page that drives with the stick against a wall: everything as it has to be for a force to be felt. */
class Driving {
  now = 1000;
  readonly fake = new ForceStickFake(() => this.now);
  readonly hid = new HidFake(this.fake);
  readonly context = {
    state: { robot: { description: { hold: 0.3 } }, feedback: { wrench: [-80, 0, 0, 0, 0, 0] } },
    driving: { arming: { state: "driving" } },
    controls: { pad: { state: { id: ID, ready: true, deadman: true } } },
    measuredMs: 1000,
  } as unknown as Mutable<ForceContext>;
  readonly forces = new ForceFeedback(this.hid, this.context);

  async step(strength: number | null = 1, isFresh = true): Promise<void> {
    this.now += 50;
    if (isFresh) this.context.measuredMs = this.now;
    this.forces.feel(strength, this.now);
    await turns();
  }

  async driving(): Promise<this> {
    await this.forces.choose();
    for (let step = 0; step < 6; step += 1) await this.step();
    expect(lengthOf(this.fake.felt())).toBeGreaterThan(0.15);
    return this;
  }
}

async function turns(): Promise<void> {
  for (let turn = 0; turn < 60; turn += 1) await Promise.resolve();
}

beforeEach(() => {
  const kept = new Map<string, string>();
  vi.stubGlobal("localStorage", {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => kept.set(key, value),
  });
  return () => vi.unstubAllGlobals();
});

describe("forces", () => {
  it("are felt by the hand that drives with this very stick, and are small at first", async () => {
    const { fake } = await new Driving().driving();
    expect(fake.felt().ahead).toBeCloseTo(-0.2, 1);
    expect(fake.trouble).toEqual([]);
  });

  const ENDS: readonly (readonly [name: string, end: (rig: Driving) => void])[] = [
    ["the page disarms", (rig) => (rig.context.driving.arming.state = "disarmed")],
    ["the deadman is let go", (rig) => (rig.context.driving.arming.state = "armed")],
    [
      "the deadman of the stick is let go while another is held",
      (rig) => {
        if (rig.context.controls.pad?.state) rig.context.controls.pad.state.deadman = false;
      },
    ],
    [
      "another pad drives",
      (rig) => {
        if (rig.context.controls.pad?.state)
          rig.context.controls.pad.state.id = "Pad (Vendor: 0001 Product: 0002)";
      },
    ],
    ["no pad drives", (rig) => (rig.context.controls.pad = null)],
    ["the robot is gone", (rig) => (rig.context.state.robot = null)],
    ["no feedback is known", (rig) => (rig.context.state.feedback = null)],
  ];
  it.each(ENDS)("end when %s", async (_name, end) => {
    const rig = await new Driving().driving();
    end(rig);
    await rig.step();
    expect(rig.fake.felt()).toEqual(FREE);
  });

  it("end when nothing may be felt: a stop, a lost connection, a hidden page", async () => {
    const rig = await new Driving().driving();
    await rig.step(null);
    expect(rig.fake.felt()).toEqual(FREE);
    await (await new Driving().driving()).step();
  });

  it("end when the last measurement is as old as the robot's hold", async () => {
    const rig = await new Driving().driving();
    const last = rig.now;
    for (let step = 0; step < 6; step += 1) await rig.step(1, false);
    expect(lengthOf(rig.fake.felt())).toBeGreaterThan(0);
    await rig.step(1, false);
    expect(rig.now - last).toBe(350);
    expect(rig.fake.felt()).toEqual(FREE);
  });

  it("end at once when told to stop, and by themselves when the page dies", async () => {
    const rig = await new Driving().driving();
    rig.forces.stop();
    await turns();
    expect(rig.fake.felt()).toEqual(FREE);
    const other = await new Driving().driving();
    expect(other.fake.felt(other.now + 300)).toEqual(FREE);
  });

  it("end when the stick is unplugged; plugged in again it is taken again", async () => {
    const rig = await new Driving().driving();
    rig.hid.plug(false);
    expect(rig.forces.stick).toBeNull();
    expect(rig.forces.words).toContain("unplugged");
    rig.hid.plug(true);
    await turns();
    expect(rig.forces.stick).not.toBeNull();
    for (let step = 0; step < 4; step += 1) await rig.step();
    expect(lengthOf(rig.fake.felt())).toBeGreaterThan(0.1);
    expect(rig.fake.trouble).toEqual([]);
  });
});

describe("a stick", () => {
  it("is remembered until it is forgotten", async () => {
    const rig = await new Driving().driving();
    const next = new ForceFeedback(new HidFake(new ForceStickFake(() => 0), true), rig.context);
    expect(await next.resume()).toBe(true);
    expect(next.stick).not.toBeNull();
    await next.forget();
    expect(JSON.parse(localStorage.getItem(FORCE_KEY) ?? "")).toMatchObject({ stick: null });
    const last = new ForceFeedback(new HidFake(new ForceStickFake(() => 0), true), rig.context);
    await last.resume();
    expect(last.stick).toBeNull();
  });

  it("that is not chosen changes nothing, and one that cannot push says why", async () => {
    const rig = new Driving();
    rig.fake.plugged = false;
    await rig.forces.choose();
    expect([rig.forces.stick, rig.forces.words]).toEqual([null, ""]);
    rig.fake.plugged = true;
    rig.fake.managesPool = false;
    await rig.forces.choose();
    expect(rig.forces.words).toContain("cannot push: its host would have to manage its memory");
    expect(localStorage.getItem(FORCE_KEY)).not.toContain("vendorId");
  });

  it("is not looked for where the console does not allow it", async () => {
    const rig = new Driving();
    rig.hid.getDevices = () => Promise.reject(new DOMException("no", "SecurityError"));
    expect(await rig.forces.resume()).toBe(false);
  });
});
