import { choosePad } from "../gamepad/selection";
import { EPISODE_PRESSES, type EpisodePress } from "../gamepad/episode_presses";
import type { PadAction } from "../gamepad/layout";
import { createReportTimeout, notePadReport, type ReportTimeout } from "../gamepad/report_timeout";
import { readPad, type PadInputs, type SeenAtRest } from "../gamepad/mapping";
import { padName, setupOf, type PadSetup } from "../gamepad/profile";
import { speedShare } from "../gamepad/shaping";
import type { GamepadStorage } from "./gamepad_storage";

export interface PadEvents {
  stop(): void;
  arm(): void;
  nextLayer(): void;
  /** The robot's action at this place of its description was asked for. */
  action(index: number): void;
  /** Something was asked of the episode. */
  episode(press: EpisodePress): void;
  lost(): void;
  /** The one whose deadman is held reports no more: it is out of range, or out of power. */
  silent(): void;
  /** A pad came or went, in words. */
  plugged(words: string): void;
}

/** What the pad in use holds now. */
export interface PadState {
  readonly id: string; // Gamepad.id
  readonly name: string;
  readonly setup: PadSetup;
  readonly ready: boolean; // false: it has to be calibrated before it can drive
  readonly deadman: boolean;
  readonly inputs: PadInputs; // with the pad's own speed share in them
  readonly pressed: ReadonlySet<PadAction>;
  readonly marks: boolean; // the cross is held up together with the button for episodes
  readonly gamepad: Gamepad;
}

interface Known {
  readonly id: string;
  readonly seen: SeenAtRest;
  readonly silence: ReportTimeout;
  readMs: number; // Gamepad.timestamp of the report that was read last
  pressed: ReadonlySet<PadAction> | null; // null: not read yet, so nothing is a new press
  marks: boolean;
}

/** The gamepad in use, and STOP of all others. Polled, because browsers tell of no button presses. */
export class Pad {
  state: PadState | null = null;
  private readonly known = new Map<number, Known>(); // by Gamepad.index
  private chosen: { index: number; id: string } | null = null;
  isSuspended = false;

  constructor(
    private readonly events: PadEvents,
    readonly storage: GamepadStorage,
  ) {}

  /** All pads that are plugged in and were touched. */
  all(): Gamepad[] {
    return navigator
      .getGamepads()
      .filter((pad) => pad !== null)
      .filter((pad) => pad.connected);
  }

  /** From now on this pad drives. */
  choose(pad: Gamepad): void {
    this.chosen = { index: pad.index, id: pad.id };
    this.storage.prefer(pad.id);
  }

  /** While suspended no pad does anything: one is being calibrated. */
  suspend(suspended: boolean): void {
    this.isSuspended = suspended;
    for (const known of this.known.values()) known.pressed = null;
  }

  /** Whether a pad has reported since it was read. With pads that give no times it never has. */
  get hasNews(): boolean {
    return this.all().some((pad) => this.known.get(pad.index)?.readMs !== pad.timestamp);
  }

  /**
   * Reads all pads, and tells of what was pressed since the last time. `isTick`: only reads at the ticks count for whether
   * a pad has fallen silent, since its rule goes by their rate.
   */
  poll(isTick = true): void {
    const pads = this.all();
    this.notePlugs(pads);
    const before = this.state;
    const states = pads.map((pad) => this.read(pad));
    const candidates = states.map(({ gamepad, ready }) => ({ index: gamepad.index, id: gamepad.id, ready }));
    const index = choosePad(candidates, this.chosen, this.storage.saved.preferred);
    const state = states.find(({ gamepad }) => gamepad.index === index) ?? null;
    this.chosen = state === null ? null : { index: state.gamepad.index, id: state.id };
    this.state = this.isSuspended ? null : state;
    const isOther = before?.gamepad.index !== state?.gamepad.index || before?.id !== state?.id;
    if (before?.ready === true && isOther) this.events.lost();
    for (const pad of pads) this.knownOf(pad).readMs = pad.timestamp;
    if (isTick) this.listen(pads, performance.now());
    if (!this.isSuspended) for (const each of states) this.tellPresses(each, each === state);
  }

  /** A pad out of range keeps what was held last. */
  private listen(pads: readonly Gamepad[], now: number): void {
    for (const pad of pads) {
      const isSilent = notePadReport(this.knownOf(pad).silence, pad, now);
      if (isSilent && pad.index === this.state?.gamepad.index && this.state.deadman) this.events.silent();
    }
  }

  private read(gamepad: Gamepad): PadState {
    const setup = setupOf(gamepad, this.storage.saved.profiles);
    const { layout, shaping } = setup;
    const common = { id: gamepad.id, name: padName(gamepad.id), setup, gamepad };
    if (layout === null) return { ...common, ready: false, ...LET_GO };
    const { inputs, pressed } = readPad(gamepad, layout, shaping, this.knownOf(gamepad).seen);
    const isEpisode = pressed.has("episode"); // the other buttons mean something else meanwhile
    const share = speedShare(shaping, pressed.has("slow"), pressed.has("turbo") && !isEpisode);
    return {
      ...common,
      ready: true,
      deadman: pressed.has("deadman"),
      inputs: scaled(isEpisode ? { ...inputs, dpad_x: 0, dpad_y: 0 } : inputs, share),
      pressed,
      marks: isEpisode && inputs.dpad_y <= -0.5,
    };
  }

  /** Any pad stops the robot; only the one in use does more. */
  private tellPresses({ gamepad, pressed, marks }: PadState, inUse: boolean): void {
    const known = this.knownOf(gamepad);
    const { pressed: before, marks: marked } = known;
    [known.pressed, known.marks] = [pressed, marks];
    if (before === null) return;
    const isNew = (action: PadAction): boolean => pressed.has(action) && !before.has(action);
    if (isNew("stop")) this.events.stop();
    if (!inUse) return;
    if (isNew("arm")) this.events.arm();
    if (pressed.has("episode")) {
      for (const [action, press] of EPISODE_PRESSES) if (isNew(action)) this.events.episode(press);
      if (marks && !marked) this.events.episode("mark");
      return;
    }
    if (isNew("layer")) this.events.nextLayer();
    const further = pressed.has("slow") ? 2 : 0; // with the left bumper: the third and the fourth
    if (isNew("action_1")) this.events.action(further);
    if (isNew("action_2")) this.events.action(further + 1);
  }

  private knownOf(gamepad: Gamepad): Known {
    const known = this.known.get(gamepad.index);
    if (known !== undefined && known.id === gamepad.id) return known;
    const fresh: Known = {
      id: gamepad.id,
      seen: new Set(),
      silence: createReportTimeout(),
      readMs: -1,
      pressed: null,
      marks: false,
    };
    this.known.set(gamepad.index, fresh);
    return fresh;
  }

  private notePlugs(pads: readonly Gamepad[]): void {
    for (const [index, known] of this.known)
      if (!pads.some((pad) => pad.index === index && pad.id === known.id)) {
        this.known.delete(index);
        this.events.plugged(`Gamepad disconnected: ${padName(known.id)}`);
      }
    for (const pad of pads) {
      if (this.known.has(pad.index)) continue;
      this.knownOf(pad);
      this.events.plugged(`Gamepad connected: ${padName(pad.id)}`);
    }
  }
}

const NOTHING: PadInputs = {
  left_x: 0,
  left_y: 0,
  right_x: 0,
  right_y: 0,
  dpad_x: 0,
  dpad_y: 0,
  triggers: 0,
};
/** Of a pad that cannot be read yet. */
const LET_GO = { deadman: false, inputs: NOTHING, pressed: new Set<PadAction>(), marks: false };

function scaled(inputs: PadInputs, share: number): PadInputs {
  return {
    left_x: inputs.left_x * share,
    left_y: inputs.left_y * share,
    right_x: inputs.right_x * share,
    right_y: inputs.right_y * share,
    dpad_x: inputs.dpad_x * share,
    dpad_y: inputs.dpad_y * share,
    triggers: inputs.triggers * share,
  };
}
