/** Fades faster than a segment lasts and slower than a click. */
const RAMP_S = 0.004;
/** The gate must confirm itself this often, else the sound fades out on its own: a stalled page falls silent. */
const CONFIRM_S = 0.08;

/** The speaker of one medium behind a gain that shuts by itself. */
export class SoundOutput {
  private readonly gain: GainNode;
  private readonly meter: AnalyserNode;
  private readonly samples: Float32Array<ArrayBuffer>;

  constructor(private readonly context: AudioContext) {
    this.gain = new GainNode(context, { gain: 0 });
    this.meter = new AnalyserNode(context, { fftSize: 1024 });
    this.samples = new Float32Array(this.meter.fftSize);
    this.gain.connect(this.meter).connect(context.destination);
  }

  connect(source: AudioNode): void {
    source.connect(this.gain);
  }

  /** Lets sound through until the next call is due, or shuts it. */
  open(isOpen: boolean): void {
    const { gain } = this.gain;
    const now = this.context.currentTime;
    gain.cancelScheduledValues(now);
    gain.setTargetAtTime(isOpen ? 1 : 0, now, RAMP_S);
    if (isOpen) gain.setTargetAtTime(0, now + CONFIRM_S, RAMP_S);
  }

  /** Loudness of what is heard: 0 to 1, -60 dBFS to full scale. */
  level(): number {
    this.meter.getFloatTimeDomainData(this.samples);
    const power = this.samples.reduce((sum, sample) => sum + sample * sample, 0) / this.samples.length;
    return power <= 0 ? 0 : Math.min(1, Math.max(0, 1 + Math.log10(power) / 6));
  }

  close(): void {
    this.gain.disconnect();
    this.meter.disconnect();
  }
}
