/** A tone that rises with the contact force, for operators who look elsewhere. */
export class ContactTone {
  private readonly oscillator: OscillatorNode;
  private readonly gain: GainNode;

  constructor(private readonly context: AudioContext) {
    this.oscillator = new OscillatorNode(context, { type: "triangle", frequency: 220 });
    this.gain = new GainNode(context, { gain: 0 });
    this.oscillator.connect(this.gain).connect(context.destination);
    this.oscillator.start();
  }

  /** `strength`: 0 (silent) to 1. */
  sound(strength: number): void {
    const now = this.context.currentTime;
    this.gain.gain.setTargetAtTime(strength > 0 ? 0.04 + 0.1 * strength : 0, now, 0.02);
    if (strength > 0) this.oscillator.frequency.setTargetAtTime(220 + 660 * strength, now, 0.02);
  }

  close(): void {
    this.oscillator.stop();
    this.gain.disconnect();
  }
}
