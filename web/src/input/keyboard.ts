import { Disposal } from "./disposal";
import { CONTROLS } from "./pointer_focus";

export interface KeyboardEvents {
  stop(): void;
  arm(): void;
  nextLayer(): void;
  isArmed(): boolean;
  /** Asks for the robot's action at this place, unless the key drives the robot; says whether it is taken. */
  actionKey(index: number, code: string): boolean;
  /** Answers whoever asks for the seat; says whether anybody does. */
  answerClaim(grant: boolean): boolean;
  /** Keys that drive, or a touch stick, are held otherwise. `at`: when that happened, by the page's clock. */
  changed(at: number): void;
}

const STOP_KEYS = new Set(["Escape", "Backspace"]);
const ARM_KEYS = new Set(["Enter", "NumpadEnter"]);
/** The holder of the seat has to be able to answer while all other keys drive. */
const ANSWER_KEYS: ReadonlyMap<string, boolean> = new Map([
  ["F8", true],
  ["F9", false],
]);
const ACTION_KEY = /^Digit([1-9])$/;
export const FIELDS = "input, textarea, select";

/** Whether this key says STOP: everywhere, but that a field keeps the one that deletes in it. */
export function isStopKey(event: KeyboardEvent): boolean {
  const inField = event.target instanceof Element && event.target.matches(FIELDS);
  return STOP_KEYS.has(event.code) && !(inField && event.code === "Backspace");
}

/** Keys held now. While armed, keys drive; else they work the page as anywhere. */
export class Keyboard {
  readonly keys = new Set<string>();
  private readonly disposal = new Disposal();

  constructor(private readonly events: KeyboardEvents) {
    this.disposal.listen(window, "keydown", (event) => this.down(event), { capture: true });
    this.disposal.listen(window, "keyup", (event) => this.up(event), { capture: true });
  }

  get deadman(): boolean {
    return this.keys.has("Space");
  }

  get slow(): boolean {
    return this.keys.has("ShiftLeft") || this.keys.has("ShiftRight");
  }

  /** Forgets all keys: their release may never be seen. */
  release(): void {
    this.keys.clear();
  }

  close(): void {
    this.disposal.close();
    this.release();
  }

  /** Keys of a frame inside the page: only STOP passes. */
  foreign(event: Pick<KeyboardEvent, "code" | "repeat">): void {
    if (STOP_KEYS.has(event.code) && !event.repeat) this.events.stop();
  }

  private down(event: KeyboardEvent): void {
    const target = event.target instanceof Element ? event.target : null;
    const inField = target?.matches(FIELDS) ?? false;
    if (isStopKey(event)) {
      event.preventDefault();
      if (!event.repeat) this.events.stop();
      return;
    }
    if (event.code === "") return;
    const answer = ANSWER_KEYS.get(event.code);
    if (answer !== undefined && !event.repeat && this.events.answerClaim(answer)) {
      event.preventDefault();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (this.events.isArmed() && !inField) this.drive(event);
    else this.idle(event, inField || (target?.matches(CONTROLS) ?? false));
  }

  /** Some browsers press a focused button when the space bar is let go, whatever became of the key's way down. */
  private up(event: KeyboardEvent): void {
    if (this.keys.delete(event.code)) this.events.changed(event.timeStamp);
    const inField = event.target instanceof Element && event.target.matches(FIELDS);
    if (this.events.isArmed() && !inField) event.preventDefault();
  }

  private drive(event: KeyboardEvent): void {
    event.preventDefault();
    if (event.repeat || this.acts(event)) return;
    if (event.code === "Tab") this.events.nextLayer();
    else this.keys.add(event.code);
    this.events.changed(event.timeStamp);
  }

  private acts(event: KeyboardEvent): boolean {
    const digit = ACTION_KEY.exec(event.code)?.[1];
    return digit !== undefined && this.events.actionKey(Number(digit) - 1, event.code);
  }

  /** The space bar still counts as held where it works a button: arming needs it seen released. */
  private idle(event: KeyboardEvent, onControl: boolean): void {
    if (event.repeat) return;
    this.keys.add(event.code);
    if (onControl) return;
    if (this.acts(event)) return;
    if (event.code === "Space") event.preventDefault();
    if (ARM_KEYS.has(event.code)) this.events.arm();
  }
}
