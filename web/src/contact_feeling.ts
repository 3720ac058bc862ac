import { contactStrength } from "./core/contact";
import { Rumble } from "./input/rumble";
import type { AudioDesk } from "./media/audio_desk";
import { ContactTone } from "./media/contact_tone";
import type { WrenchSensor } from "./wire";

const FEEL_MS = 50;

/** What of a contact may be felt and heard now. */
export interface Feeling {
  readonly force: number; // N
  readonly sensor: WrenchSensor | null; // null: nothing may be felt
  readonly pad: Gamepad | null; // null: not by rumble
  readonly audible: boolean;
}

/** Lets the operator feel a contact as rumble and hear it as a tone. */
export class ContactFeeling {
  private readonly rumble = new Rumble();
  private readonly tone: ContactTone;
  private dueMs = 0;

  constructor(audio: AudioDesk) {
    this.tone = new ContactTone(audio);
  }

  isDue(now: number): boolean {
    return now >= this.dueMs;
  }

  feel({ force, sensor, pad, audible }: Feeling, now: number): void {
    this.dueMs = now + FEEL_MS;
    const strength = sensor === null ? 0 : contactStrength(force, sensor);
    this.rumble.feel(pad, strength, now);
    this.tone.sound(audible ? strength : 0);
  }

  /** No more rumble until the next feeling. */
  still(): void {
    this.rumble.stop();
  }

  close(): void {
    this.still();
    this.tone.close();
  }
}
