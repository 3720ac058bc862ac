import { isPressed, isStandard, PAD_BUTTONS, readPad, type PadInputs } from "../core/pad_mapping";

export interface PadEvents {
  stop(): void;
  arm(): void;
  nextLayer(): void;
  lost(): void;
}

/** What one pad holds now. */
export interface PadState {
  readonly id: string;
  readonly standard: boolean; // false: the browser does not know which button is which
  readonly deadman: boolean;
  readonly slow: boolean;
  readonly inputs: PadInputs;
  readonly gamepad: Gamepad;
}

/** The first gamepad that shows itself. Polled, because browsers tell of no button presses. */
export class Pad {
  state: PadState | null = null;
  private pressed = new Set<number>();

  constructor(private readonly events: PadEvents) {}

  /** Reads the pad, and tells of buttons pressed since the last time. */
  poll(): void {
    const gamepad = findGamepad(this.state?.gamepad.index);
    const had = this.state;
    this.state = gamepad === null ? null : stateOf(gamepad);
    if (had !== null && this.state === null) this.events.lost();
    if (this.state?.standard === true) this.tellPresses(this.state.gamepad);
    else this.pressed.clear();
  }

  private tellPresses(gamepad: Gamepad): void {
    const now = new Set([...gamepad.buttons.keys()].filter((button) => isPressed(gamepad, button)));
    const isNew = (button: number): boolean => now.has(button) && !this.pressed.has(button);
    if (PAD_BUTTONS.stop.some(isNew)) this.events.stop();
    if (isNew(PAD_BUTTONS.arm)) this.events.arm();
    if (isNew(PAD_BUTTONS.layer)) this.events.nextLayer();
    this.pressed = now;
  }
}

function findGamepad(index: number | undefined): Gamepad | null {
  const pads = navigator.getGamepads().filter((pad) => pad?.connected === true);
  return (
    pads.find((pad) => pad?.index === index) ??
    pads.find((pad) => pad?.mapping === "standard") ??
    pads[0] ??
    null
  );
}

function stateOf(gamepad: Gamepad): PadState {
  const standard = isStandard(gamepad);
  return {
    id: gamepad.id.replace(/\s*\(.*$/, "") || "Gamepad",
    standard,
    deadman: standard && isPressed(gamepad, PAD_BUTTONS.deadman),
    slow: standard && isPressed(gamepad, PAD_BUTTONS.slow),
    inputs: readPad(gamepad),
    gamepad,
  };
}
