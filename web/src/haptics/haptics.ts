import type { ArmConditions } from "../drive/arming";
import type { ConsoleState } from "../session/console_state";
import { contactStrength, feelingOf, forceOf } from "./contact_force";
import { clearTrace, createForceTrace, noteForce } from "./force_trace";
import { Rumble } from "./rumble";
import { ContactTone } from "./contact_tone";
import type { Feedback, ForceFeeling } from "../protocol/wire";

const REFRESH_MS = 50;
const FELT_MS = 1000; // a force that was measured longer ago is not felt

/** What the operator may feel, and with which pad. */
export interface HapticsContext {
  readonly state: Pick<ConsoleState, "robot" | "settings">;
  readonly controls: { readonly felt: Gamepad | null };
  readonly streams: { isAudible(): boolean };
  readonly measuredMs: number | null; // when the newest feedback came
  readonly driving: { isArmed(): boolean };
  conditions(now: number): Pick<ArmConditions, "connected" | "stopped" | "visible">;
}

/** A stick that pushes back. */
export interface PushingStick {
  /** `strength`: of the contact, 0 to 1; null while nothing may be felt. */
  feel(strength: number | null, now: number): void;
  stop(): void;
  close(): void;
}

/** Lets the operator feel a contact as rumble and hear it as a tone: from the feedback itself, before any picture of it. */
export class Haptics {
  readonly trace = createForceTrace();
  private force = 0; // N
  stick: PushingStick | null = null; // until one was chosen
  private dueMs = 0;

  constructor(
    private readonly context: HapticsContext,
    private readonly rumble: Rumble,
    private readonly tone: ContactTone,
  ) {}

  took(feedback: Feedback, now: number): void {
    this.force = forceOf(feedback.wrench);
    noteForce(this.trace, feedback.event, this.force);
    this.feel(now);
  }

  /** Called at a fixed rate: effects end by themselves and are renewed. */
  step(now: number): void {
    if (now >= this.dueMs) this.feel(now);
  }

  /** Nothing is felt or heard until the next feeling. */
  still(): void {
    this.rumble.stop();
    this.tone.sound(0);
    this.stick?.stop();
  }

  /** What was felt belonged to a connection that ended. */
  forget(): void {
    this.still();
    this.force = 0;
    clearTrace(this.trace);
  }

  close(): void {
    this.still();
    this.tone.close();
    this.stick?.close();
  }

  private feel(now: number): void {
    this.dueMs = now + REFRESH_MS;
    const { context } = this;
    const { settings } = context.state;
    const by = this.feeling(now);
    const strength = by === null ? 0 : contactStrength(this.force, by);
    const felt = settings.rumble && context.driving.isArmed() ? context.controls.felt : null;
    this.rumble.feel(felt, strength, now);
    this.tone.sound(settings.contactTone && context.streams.isAudible() ? strength : 0);
    this.stick?.feel(by === null ? null : strength, now);
  }

  /** How a contact feels; null while nothing may be felt. */
  private feeling(now: number): ForceFeeling | null {
    const { visible, stopped, connected } = this.context.conditions(now);
    const { robot } = this.context.state;
    const { measuredMs } = this.context;
    if (!visible || stopped || !connected || robot === null) return null;
    return measuredMs !== null && now - measuredMs < FELT_MS ? feelingOf(robot.description) : null;
  }
}

/** With the pads' motors and the page's speakers. */
export function createHaptics(
  context: HapticsContext & { readonly audio: ConstructorParameters<typeof ContactTone>[0] },
): Haptics {
  return new Haptics(context, new Rumble(), new ContactTone(context.audio));
}
