import type { AudioDevice } from "../media/sound/audio_device";

const LASTS_SECONDS = 0.3;

/** A tone that rises with the contact force, for operators who look elsewhere. */
export class ContactTone {
  private voice: { oscillator: OscillatorNode; gain: GainNode } | null = null;

  constructor(private readonly audio: AudioDevice) {}

  /** `strength`: 0 (silent) to 1. */
  sound(strength: number): void {
    if (strength <= 0 && this.voice === null) return;
    if (this.voice?.gain.context !== this.audio.open()) this.voice = this.createVoice();
    const { oscillator, gain } = this.voice;
    const now = gain.context.currentTime;
    gain.gain.cancelScheduledValues(now);
    gain.gain.setTargetAtTime(strength > 0 ? 0.04 + 0.1 * strength : 0, now, 0.02);
    // It ends by itself: a page that stands still must not go on sounding a contact that is over.
    if (strength > 0) gain.gain.setTargetAtTime(0, now + LASTS_SECONDS, 0.02);
    if (strength > 0) oscillator.frequency.setTargetAtTime(220 + 660 * strength, now, 0.02);
  }

  close(): void {
    this.voice?.oscillator.stop();
    this.voice?.gain.disconnect();
  }

  private createVoice(): { oscillator: OscillatorNode; gain: GainNode } {
    const context = this.audio.open();
    const oscillator = new OscillatorNode(context, { type: "triangle", frequency: 220 });
    const gain = new GainNode(context, { gain: 0 });
    oscillator.connect(gain).connect(context.destination);
    oscillator.start();
    return { oscillator, gain };
  }
}
