import {
  isSameDevice,
  readKeptStick,
  writeKeptStick,
  type ForceSettings,
  type KeptStick,
} from "../force_feedback/force_settings";
import { stickForce } from "../force_feedback/stick_force";
import type { Wanted } from "../force_feedback/effect_manager";
import type { ConsoleState } from "../session/console_state";
import type { ArmState } from "../drive/arming";
import { ForceStick, StickUnusable, type HidDevice } from "./force_stick";

export const FORCE_KEY = "lockstep.force";

/** WebHID's navigator.hid, as far as it is used here. */
export interface Hid {
  getDevices(): Promise<HidDevice[]>;
  requestDevice(options: { readonly filters: readonly HidFilter[] }): Promise<HidDevice[]>;
  addEventListener(
    type: "connect" | "disconnect",
    listener: (event: { readonly device: HidDevice }) => void,
  ): void;
}

interface HidFilter {
  readonly usagePage: number;
  readonly usage?: number;
}

/** Filters see the topmost collections alone, and a stick's force feedback lies below: joysticks, pads, wheels, PID. */
const FILTERS: readonly HidFilter[] = [
  { usagePage: 0x01, usage: 0x04 },
  { usagePage: 0x01, usage: 0x05 },
  { usagePage: 0x02 },
  { usagePage: 0x0f },
];

/** Who drives, with what, and what was measured last. */
export interface ForceContext {
  readonly state: Pick<ConsoleState, "robot" | "feedback">;
  readonly driving: { readonly arming: { readonly state: ArmState } };
  readonly controls: {
    readonly pad: {
      readonly state: { readonly id: string; readonly ready: boolean; readonly deadman: boolean } | null;
    } | null;
  };
  readonly measuredMs: number | null;
}

/** One stick that pushes back with the contact force: chosen, remembered, opened, and told what the hand may feel. */
export class ForceFeedback {
  /** A message for the stick's owner; "" for none. */
  words = "";
  stick: ForceStick | null = null;
  private kept: KeptStick = readKeptStick(load());
  private opening = false;
  private closing: Promise<void> = Promise.resolve(); // a device that comes back may be the same object

  constructor(
    private readonly hid: Hid,
    private readonly context: ForceContext,
  ) {
    hid.addEventListener("connect", ({ device }) => {
      if (this.isKept(device)) void this.take(device);
    });
    hid.addEventListener("disconnect", ({ device }) => {
      if (device === this.stick?.device) this.drop("The stick was unplugged");
    });
  }

  get settings(): ForceSettings {
    return this.kept.settings;
  }

  set settings(settings: ForceSettings) {
    this.keep({ ...this.kept, settings });
    if (this.stick !== null) this.stick.settings = settings;
  }

  /** Whether pages of this console may ask for devices at all. Takes the stick that was in use at the last visit. */
  async resume(): Promise<boolean> {
    try {
      const known = (await this.hid.getDevices()).find((device) => this.isKept(device));
      if (known !== undefined) await this.take(known);
      return true;
    } catch {
      return false; // Permissions-Policy: hid=()
    }
  }

  /** Lets the person choose a device; only in answer to a click. */
  async choose(): Promise<void> {
    try {
      const [device] = await this.hid.requestDevice({ filters: FILTERS });
      if (device === undefined) return; // nothing was chosen
      await this.forget();
      if (await this.take(device)) {
        const { vendorId, productId } = device;
        this.keep({ ...this.kept, stick: { vendorId, productId } });
      }
    } catch {
      this.words = "The browser lets this page use no device";
    }
  }

  async forget(): Promise<void> {
    const { stick } = this;
    this.stick = null;
    this.words = "";
    this.keep({ ...this.kept, stick: null });
    await stick?.close();
  }

  /** `strength`: of the contact, 0 to 1; null while nothing may be felt. */
  feel(strength: number | null, now: number): void {
    this.stick?.feel(strength === null ? null : this.wanted(strength, now), now);
  }

  /** Ends everything at once. */
  stop(): void {
    this.stick?.feel(null, performance.now());
  }

  close(): void {
    void this.stick?.close();
    this.stick = null;
  }

  /** Whether the pad that drives is this stick, in words for its owner. */
  get use(): string {
    const { stick } = this;
    if (stick === null) return "";
    const pad = this.context.controls.pad?.state ?? null;
    if (pad !== null && isSameDevice(pad.id, stick.device)) return "pushes while it drives";
    return "does not drive, so it does not push: choose it above";
  }

  /**
   * A force is felt by the hand that drives: while it holds this very stick and its deadman. A stick that nobody holds
   * would be moved by the force, and the robot with it. No force outlives the event that it belongs to.
   */
  private wanted(strength: number, now: number): Wanted | null {
    const { driving, controls, measuredMs, state } = this.context;
    const { stick } = this;
    const { robot, feedback } = state;
    const pad = controls.pad?.state ?? null;
    if (stick === null || robot === null || feedback === null || measuredMs === null) return null;
    const holdSeconds = robot.description.hold;
    if (now - measuredMs > 1000 * holdSeconds || driving.arming.state !== "driving") return null;
    if (pad?.ready !== true || !pad.deadman || !isSameDevice(pad.id, stick.device)) return null;
    return { force: stickForce(feedback.wrench, strength), holdSeconds };
  }

  private isKept({ vendorId, productId }: HidDevice): boolean {
    const { stick } = this.kept;
    return this.stick === null && stick?.vendorId === vendorId && stick.productId === productId;
  }

  private async take(device: HidDevice): Promise<boolean> {
    if (this.opening) return false;
    this.opening = true;
    try {
      await this.closing;
      const name = device.productName === "" ? "This device" : device.productName;
      this.stick = await ForceStick.open(device, this.settings, () => this.drop(`${name} answers no more`));
      this.words = "";
      return true;
    } catch (error) {
      if (!(error instanceof StickUnusable)) throw error;
      this.words = `${device.productName} cannot push: ${error.message}`;
      return false;
    } finally {
      this.opening = false;
    }
  }

  private drop(words: string): void {
    const { stick } = this;
    this.stick = null;
    this.words = words;
    if (stick !== null) this.closing = stick.close();
  }

  private keep(kept: KeptStick): void {
    this.kept = kept;
    try {
      localStorage.setItem(FORCE_KEY, writeKeptStick(kept));
    } catch {
      // It holds until the page closes.
    }
  }
}

function load(): string | null {
  try {
    return localStorage.getItem(FORCE_KEY);
  } catch {
    return null;
  }
}
