/** The page's audio worklet: plays decoded packets on the sound device's own thread. */
import {
  PROCESSOR,
  isSoundPacket,
  type PlayoutNote,
  type ProcessorOptions,
  type ProcessorOrder,
} from "./sound_messages";
import {
  createSoundPlayer,
  judgeAgainst,
  nextFrame,
  playingRate,
  takePacket,
  waitingMs,
} from "./sound_player";
import { createSoundResampler, resample } from "./sound_resampler";

// Names of AudioWorkletGlobalScope, which TypeScript's libraries leave out (Web Audio 1.32).
declare const currentTime: number;
declare const sampleRate: number;
declare function registerProcessor(name: string, processor: new (options: Options) => Processor): void;
declare class AudioWorkletProcessor {
  readonly port: MessagePort;
}

interface Options {
  readonly processorOptions: ProcessorOptions;
}

interface Processor {
  process(inputs: readonly Float32Array[][], outputs: readonly Float32Array[][]): boolean;
}

class SoundProcessor extends AudioWorkletProcessor implements Processor {
  private readonly player;
  private readonly resampler = createSoundResampler();
  private readonly step: number;
  private packets: MessagePort | null = null;
  private isOpen = true;
  private noted: number | null = null; // what played at the last note

  constructor({ processorOptions: { rate, blockS } }: Options) {
    super();
    this.player = createSoundPlayer(rate, blockS);
    this.step = rate / sampleRate;
    this.port.onmessage = ({ data }: MessageEvent<ProcessorOrder>) => this.obey(data);
  }

  process(_inputs: readonly Float32Array[][], outputs: readonly Float32Array[][]): boolean {
    const output = outputs[0]?.[0];
    const { player } = this;
    if (output !== undefined) {
      const step = this.step * playingRate(player, currentTime);
      resample(this.resampler, output, step, () => nextFrame(player, currentTime));
      this.note();
    }
    return this.isOpen;
  }

  private obey(order: ProcessorOrder): void {
    if ("close" in order) {
      this.isOpen = false;
      this.packets?.close();
    } else if ("packets" in order) {
      this.packets?.close();
      this.packets = order.packets;
      this.packets.onmessage = ({ data }: MessageEvent<unknown>) => this.take(data);
    } else judgeAgainst(this.player, order, currentTime);
  }

  private take(data: unknown): void {
    if (isSoundPacket(data)) takePacket(this.player, data, currentTime);
    this.packets?.postMessage(true);
  }

  private note(): void {
    const { player } = this;
    const { begun, playing, leftOut } = player;
    if (begun.length === 0 && leftOut === 0 && playing === this.noted) return;
    this.noted = playing;
    player.begun = [];
    player.leftOut = 0;
    const note: PlayoutNote = { begun, playing, waitingMs: waitingMs(player), leftOut };
    this.port.postMessage(note);
  }
}

registerProcessor(PROCESSOR, SoundProcessor);
