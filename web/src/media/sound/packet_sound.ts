import type { GateContext } from "../../gate/gate_counters";
import type { ReceiverStamps, StampReader } from "../../transport/encoded_transform/stamp_reader";
import { PROCESSOR, type PlayoutNote, type ProcessorOptions, type ProcessorOrder } from "./sound_messages";
import type { SoundContext } from "../../gate/gate_counters";
import type { SoundSource } from "./sound_source";
import workletUrl from "./sound_worklet?worker&url";

const OPUS_RATE = 48_000;
const MU_LAW_RATE = 8000; // RFC 3551 4.5.14

const loaded = new WeakMap<AudioContext, Promise<void>>();

/**
 * Sound that the page decodes in the transform worker and plays in its audio worklet, without the main thread in its
 * way: a browser's own buffer grows with every delay of a busy machine, until what it plays is no longer within the
 * tolerance.
 */
export class PacketSound implements SoundSource {
  readonly node: GainNode;
  private player: AudioWorkletNode | null = null; // null until the worklet is loaded
  private told: SoundContext | null = null;
  private note: PlayoutNote | null = null; // the newest
  private notedMs = 0;
  private isClosed = false;

  /** `begun` is called for each packet as it begins to play; `failed` where the browser has to play it. */
  constructor(
    private readonly stamps: ReceiverStamps,
    private readonly reader: StampReader,
    private readonly codec: string,
    private readonly context: AudioContext,
    private readonly begun: (rtpTimestamp: number) => void,
    failed: () => void,
  ) {
    this.node = new GainNode(context);
    stamps.onfailed = failed;
    this.load().catch(() => {
      if (!this.isClosed) failed();
    });
  }

  playing(): number | undefined {
    return this.note?.playing ?? undefined;
  }

  waiting(): number {
    if (this.note === null) return 0;
    return Math.max(0, this.note.waitingMs - (performance.now() - this.notedMs));
  }

  tell({ feedback, tolerance, gate }: GateContext): void {
    const { told } = this;
    if (told?.feedback === feedback && told.tolerance === tolerance && told.gate === gate) return;
    this.told = { feedback, tolerance, gate };
    this.order(this.told);
  }

  catchUp(): void {
    // the worklet does, by the same rule
  }

  leavesOut(): boolean {
    return false;
  }

  close(): void {
    this.isClosed = true;
    this.stamps.onfailed = null;
    this.context.removeEventListener("statechange", this.connect);
    this.reader.route(this.stamps, this.codec, null);
    this.order({ close: true });
    this.player?.disconnect();
    this.node.disconnect();
  }

  private async load(): Promise<void> {
    const { context } = this;
    const known = loaded.get(context) ?? context.audioWorklet.addModule(workletUrl);
    loaded.set(context, known);
    await known;
    if (this.isClosed) return;
    const rate = this.codec === "PCMU" ? MU_LAW_RATE : OPUS_RATE;
    const processorOptions: ProcessorOptions = { rate, blockS: context.baseLatency };
    this.player = new AudioWorkletNode(context, PROCESSOR, {
      numberOfInputs: 0,
      outputChannelCount: [1],
      processorOptions,
    });
    this.player.port.onmessage = ({ data }: MessageEvent<PlayoutNote>) => this.take(data);
    this.player.connect(this.node);
    if (this.told !== null) this.order(this.told);
    context.addEventListener("statechange", this.connect);
    this.connect();
  }

  /** Packets go to the worklet while the sound device runs: what came before would play late. */
  private readonly connect = (): void => {
    const { codec, context, reader, stamps } = this;
    if (context.state !== "running") {
      reader.route(stamps, codec, null);
      return;
    }
    const { port1, port2 } = new MessageChannel();
    this.player?.port.postMessage({ packets: port2 } satisfies ProcessorOrder, [port2]);
    reader.route(stamps, codec, port1);
  };

  private order(order: ProcessorOrder): void {
    this.player?.port.postMessage(order);
  }

  private take(note: PlayoutNote): void {
    if (this.isClosed) return;
    this.stamps.dropped += note.leftOut;
    for (const playing of note.begun) {
      this.keep({ ...note, playing });
      this.begun(playing);
    }
    this.keep(note);
  }

  private keep(note: PlayoutNote): void {
    this.note = note;
    this.notedMs = performance.now();
  }
}
