import type { ConsoleApp } from "./console_app";
import { contactStrength, feelingOf, forceOf } from "./core/contact";
import { clearTrace, createForceTrace, noteForce } from "./core/force_trace";
import type { Rumble } from "./input/rumble";
import type { ContactTone } from "./media/contact_tone";
import type { Feedback, ForceFeeling } from "./wire";

const REFRESH_MS = 50;
const FELT_MS = 1000; // a force that was measured longer ago is not felt

/** Lets the operator feel a contact as rumble and hear it as a tone: from the feedback itself, before any picture of it. */
export class ContactFeeling {
  readonly trace = createForceTrace();
  private force = 0; // N
  rumble: Rumble | null = null; // as the tone: until its code is there
  tone: ContactTone | null = null;
  private dueMs = 0;

  constructor(private readonly app: ConsoleApp) {}

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
    this.rumble?.stop();
    this.tone?.sound(0);
  }

  /** What was felt belonged to a connection that ended. */
  forget(): void {
    this.still();
    this.force = 0;
    clearTrace(this.trace);
  }

  close(): void {
    this.still();
    this.tone?.close();
  }

  private feel(now: number): void {
    this.dueMs = now + REFRESH_MS;
    const { app } = this;
    const { settings } = app.state;
    const by = this.feeling(now);
    const strength = by === null ? 0 : contactStrength(this.force, by);
    const pad = settings.rumble && app.isArmed() ? app.controls.pad?.state : null;
    this.rumble?.feel(pad?.gamepad ?? null, strength, now);
    this.tone?.sound(settings.contactTone && app.room.isAudible() ? strength : 0);
  }

  /** How a contact feels; null while nothing may be felt. */
  private feeling(now: number): ForceFeeling | null {
    const { visible, stopped, connected } = this.app.conditions(now);
    const { robot } = this.app.state;
    const { measuredMs } = this.app;
    if (!visible || stopped || !connected || robot === null) return null;
    return measuredMs !== null && now - measuredMs < FELT_MS ? feelingOf(robot.description) : null;
  }
}
