/** The browser's own work against echo and noise: the robot's sound plays in the same room. */
const WANTED: MediaStreamConstraints = {
  audio: { echoCancellation: true, noiseSuppression: true, autoGainControl: true, channelCount: 1 },
};

/** This page's microphone. It is open only between `open` and `shut`, and heard only between `start` and `stop`. */
export class Microphone {
  private track: MediaStreamTrack | null = null;
  private source: MediaStreamAudioSourceNode | null = null;
  private meter: AnalyserNode | null = null;
  private samples = new Float32Array(512);

  /** Raises DOMException as getUserMedia does, TypeError where the page is not in a secure context. */
  async open(context: AudioContext): Promise<void> {
    const stream = await navigator.mediaDevices.getUserMedia(WANTED);
    const [track] = stream.getAudioTracks();
    if (track === undefined) throw new DOMException("no microphone", "NotFoundError");
    this.shut();
    this.track = track;
    this.source = context.createMediaStreamSource(stream);
    this.meter = new AnalyserNode(context, { fftSize: this.samples.length });
    this.source.connect(this.meter);
  }

  /** Whether it was taken away, as by unplugging it. */
  isLost(): boolean {
    return this.track !== null && this.track.readyState === "ended";
  }

  start(sender: RTCRtpSender): void {
    sender.replaceTrack(this.track).catch(() => undefined); // the connection has gone, and the voice with it
  }

  stop(sender: RTCRtpSender | null): void {
    sender?.replaceTrack(null).catch(() => undefined);
  }

  /** Loudness at the microphone: 0 to 1, -60 dBFS to full scale. */
  level(): number {
    if (this.meter === null) return 0;
    this.meter.getFloatTimeDomainData(this.samples);
    const power = this.samples.reduce((sum, sample) => sum + sample * sample, 0) / this.samples.length;
    return power <= 0 ? 0 : Math.min(1, Math.max(0, 1 + Math.log10(power) / 6));
  }

  shut(): void {
    this.source?.disconnect();
    this.track?.stop();
    this.source = this.meter = this.track = null;
  }
}
