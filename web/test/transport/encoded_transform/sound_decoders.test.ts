import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { SoundDecoders } from "../../../src/transport/encoded_transform/sound_decoders";
import type { SoundPacket } from "../../../src/media/sound/sound_queue";

const RECEIVER = 7;
const TWO_CHANNELS = 0x04; // of an Opus packet's first byte

/** A decoder that gives 4 samples for each packet; of a packet of zeros it makes an error, as of no Opus. */
class FakeDecoder {
  state = "unconfigured";

  constructor(private readonly init: AudioDecoderInit) {}

  configure(): void {
    this.state = "configured";
  }

  decode(chunk: FakeChunk): void {
    const channels = new Uint8Array(chunk.data)[0] === TWO_CHANNELS ? 2 : 1;
    if (new Uint8Array(chunk.data).every((byte) => byte === 0)) {
      this.state = "closed";
      this.init.error(new DOMException("not Opus"));
      return;
    }
    this.init.output({
      numberOfFrames: 4,
      numberOfChannels: channels,
      copyTo: (to: Float32Array, { planeIndex }: AudioDataCopyToOptions) =>
        to.fill(planeIndex === 0 ? 0.5 : 0.25),
      close: () => undefined,
    } as unknown as AudioData);
  }

  close(): void {
    this.state = "closed";
  }
}

class FakeChunk {
  readonly data: ArrayBuffer;

  constructor(chunk: { readonly data: ArrayBuffer }) {
    this.data = chunk.data;
  }
}

/** The end of a channel that the worker holds. */
class FakePort {
  onmessage: (() => void) | null = null;
  readonly sent: SoundPacket[] = [];
  isClosed = false;

  postMessage(packet: SoundPacket): void {
    this.sent.push(packet);
  }

  close(): void {
    this.isClosed = true;
  }
}

let decoders: SoundDecoders;
let failed: number[];
let port: FakePort;

beforeEach(() => {
  vi.stubGlobal("AudioDecoder", FakeDecoder);
  vi.stubGlobal("EncodedAudioChunk", FakeChunk);
  failed = [];
  port = new FakePort();
  decoders = new SoundDecoders((receiver) => failed.push(receiver));
});

afterEach(() => {
  vi.unstubAllGlobals();
});

function route(codec = "opus"): void {
  decoders.obey({ receiver: RECEIVER, codec, port: port as unknown as MessagePort });
}

function keep(time: number, ...bytes: number[]): boolean {
  return decoders.keep(RECEIVER, time, 3, Uint8Array.from(bytes).buffer);
}

describe("the decoders of the transform worker", () => {
  it("send each packet's sound to the worklet, with RTP timestamp, stamp and time of arrival", () => {
    route();
    expect(keep(960, 1, 2)).toBe(true);
    const [packet] = port.sent;
    expect(packet).toMatchObject({ time: 960, stamp: 3, gaveWay: 0 });
    expect([...(packet?.samples ?? [])]).toEqual([0.5, 0.5, 0.5, 0.5]);
    expect(packet?.arrivedS).toBeCloseTo(performance.now() / 1000, 0);
  });

  it("mix the channels into one", () => {
    route();
    keep(960, TWO_CHANNELS);
    expect(port.sent[0]?.samples[0]).toBe(0.375);
  });

  it("decode µ-law without the browser", () => {
    route("PCMU");
    keep(160, 0xff, 0x80);
    expect(port.sent[0]?.samples[0]).toBe(0);
    expect(port.sent[0]?.samples[1]).toBeGreaterThan(0.9);
  });

  it("keep packets from the browser's decoder before the worklet is there, and play none of them later", () => {
    expect(keep(0, 1)).toBe(true);
    route();
    expect(port.sent).toEqual([]);
  });

  it("leave a receiver's sound to the browser when they are told so", () => {
    route();
    decoders.obey({ receiver: RECEIVER, browserPlays: true });
    expect(keep(0, 1)).toBe(false);
    expect(port.isClosed).toBe(true);
    expect(decoders.keep(RECEIVER + 1, 0, 3, new ArrayBuffer(1))).toBe(true);
  });

  it("go on after a packet that is no Opus", () => {
    route();
    for (let index = 0; index < 20; index++) keep(index * 960, index % 2);
    expect(port.sent.length).toBe(10);
    expect(failed).toEqual([]);
  });

  it("give up after five failures without any sound between, and leave the sound to the browser", () => {
    route();
    const kept = Array.from({ length: 6 }, (_, index) => keep(index * 960, 0));
    expect(failed).toEqual([RECEIVER]);
    expect(kept.at(-1)).toBe(false);
  });

  it("have no more than twelve packets on their way, and keep the newest fifty for later", () => {
    route();
    for (let index = 0; index < 100; index++) keep(index, 1);
    expect(port.sent.length).toBe(12);
    for (let taken = 0; taken < 12; taken++) port.onmessage?.();
    const [next] = port.sent.slice(12);
    expect(next).toMatchObject({ time: 50, gaveWay: 38 });
    expect(port.sent.slice(13).every(({ gaveWay }) => gaveWay === 0)).toBe(true);
  });
});
