import type { HeldInputs } from "../drive/axis_mapping";
import { createInputActivity, noteInput } from "../drive/input_activity";
import type { PadInputs } from "../gamepad/mapping";
import { Keyboard, type KeyboardEvents } from "./keyboard";
import type { Pad, PadEvents, PadState } from "./gamepad";
import type { GoalSliders } from "./goal_sliders";
import type { TouchSticks } from "./touch_sticks";

const SLOW_SHARE = 0.3;

/** What the operator holds at one sample. */
export interface ControlSample {
  readonly deadman: boolean;
  readonly held: HeldInputs;
  readonly slowShare: number; // 1, or less with the slow key; a pad's own share is in its inputs
  readonly signature: string; // the same while no hand shows
}

/** What the controllers or hands of a headset hold. */
export interface HeadsetControls {
  readonly deadman: boolean;
  readonly inputs: PadInputs;
  readonly gamepad: Gamepad | null; // of the hand that holds the deadman: what it may feel
  readonly signature: string; // another one when a hand moves
  release(): void;
}

/** Gamepad, keyboard and touch as one set of controls. */
export class Controls {
  pad: Pad | null = null; // until its code is there
  sliders: GoalSliders | null = null; // likewise
  readonly keyboard: Keyboard;
  headset: HeadsetControls | null = null; // while its session lasts
  private readonly activity = createInputActivity();

  constructor(
    readonly sticks: TouchSticks,
    readonly events: KeyboardEvents & PadEvents,
  ) {
    this.keyboard = new Keyboard(events);
    sticks.onchange = (at) => events.changed(at);
  }

  /** Whether a pad is in use. */
  get hasPad(): boolean {
    return this.pad !== null && this.pad.state !== null;
  }

  /** Whether a pad has reported since it was read. */
  get hasPadNews(): boolean {
    return this.pad?.hasNews === true;
  }

  /** Whether a deadman of the window is held. */
  get usesWindow(): boolean {
    const { keyboard, sticks, sliders, readyPad: pad } = this;
    return keyboard.deadman || sticks.deadman || sliders?.deadman === true || pad?.deadman === true;
  }

  /** What a contact is felt with. */
  get felt(): Gamepad | null {
    return this.headset?.gamepad ?? this.pad?.state?.gamepad ?? null;
  }

  /** Whether a deadman is held, by what is known now. */
  get deadman(): boolean {
    return this.usesWindow || this.headset?.deadman === true;
  }

  private get readyPad(): PadState | null {
    return this.pad?.state?.ready === true ? this.pad.state : null;
  }

  /** `isTick`: at a tick pads are read in any case, so that one that has fallen silent is noticed. */
  sample(isTick: boolean): ControlSample {
    if (isTick || this.hasPadNews) this.pad?.poll(isTick);
    const { keyboard, sticks, readyPad: pad } = this;
    const touch = sticks.deadman ? sticks.inputs : null;
    const sliders = this.sliders?.sample(keyboard.keys) ?? null;
    const keys = sliders?.otherKeys ?? keyboard.keys;
    const inputs = (this.headset?.deadman === true ? this.headset : pad)?.inputs ?? null;
    const held: HeldInputs = { pad: inputs, keys, touch, sliders };
    return {
      deadman: this.deadman,
      held,
      slowShare: keyboard.slow ? SLOW_SHARE : 1,
      signature: noteInput(this.activity, held) + (this.headset?.signature ?? ""),
    };
  }

  /** Forgets all that is held. */
  release(): void {
    this.keyboard.release();
    this.sticks.release();
    this.sliders?.release();
    this.headset?.release();
  }

  close(): void {
    this.release();
    this.keyboard.close();
  }
}
