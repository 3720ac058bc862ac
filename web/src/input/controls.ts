import type { HeldInputs } from "../drive/axis_mapping";
import { createInputActivity, noteInput } from "../drive/input_activity";
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

/** Gamepad, keyboard and touch as one set of controls. */
export class Controls {
  pad: Pad | null = null; // until its code is there
  sliders: GoalSliders | null = null; // likewise
  readonly keyboard: Keyboard;
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

  /** Whether a deadman is held, by what is known now. */
  get deadman(): boolean {
    const { keyboard, sticks, sliders, readyPad: pad } = this;
    return keyboard.deadman || sticks.deadman || sliders?.deadman === true || pad?.deadman === true;
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
    const held: HeldInputs = { pad: pad?.inputs ?? null, keys, touch, sliders };
    return {
      deadman: this.deadman,
      held,
      slowShare: keyboard.slow ? SLOW_SHARE : 1,
      signature: noteInput(this.activity, held),
    };
  }

  /** Forgets all that is held. */
  release(): void {
    this.keyboard.release();
    this.sticks.release();
    this.sliders?.release();
  }

  close(): void {
    this.release();
    this.keyboard.close();
  }
}
