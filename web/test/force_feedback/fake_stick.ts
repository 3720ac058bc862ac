import { readFileSync } from "node:fs";
import { join } from "node:path";
import { runInThisContext } from "node:vm";
import type { HidCollection } from "../../src/force_feedback/hid";
import type { Hid } from "../../src/haptics/force_feedback";
import type { HidDevice } from "../../src/haptics/force_stick";

/** What the hand would feel: shares of the stick's strongest. */
export interface Felt {
  readonly right: number;
  readonly ahead: number;
  readonly spring: number;
  readonly damper: number;
}

/** A fake, written from the standard: tests/e2e/driving/force_stick.js, which Chromium's tests use too. */
export interface StickFake extends HidDevice {
  plugged: boolean;
  room: number;
  managesPool: boolean;
  readonly sent: (readonly [time: number, id: number, bytes: readonly number[]])[];
  readonly trouble: readonly string[];
  readonly until: number;
  felt(now?: number): Felt;
}

export interface HidFake extends Hid {
  readonly asked: readonly unknown[];
  plug(plugged: boolean): void;
}

interface Fakes {
  readonly ForceStickFake: new (now: () => number, collections?: readonly HidCollection[]) => StickFake;
  readonly HidFake: new (stick: StickFake, granted?: boolean) => HidFake;
  readonly forceStickCollections: () => HidCollection[];
}

runInThisContext(
  readFileSync(join(import.meta.dirname, "../../../tests/e2e/driving/force_stick.js"), "utf8"),
);

export const { ForceStickFake, HidFake, forceStickCollections } = globalThis as unknown as Fakes;
