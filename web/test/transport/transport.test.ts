/** What holds for every transport of the page: both run the same cases. */
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { WebSocketTransport, type Socket } from "../../src/transport/websocket_transport";
import type { WhepApi } from "../../src/transport/signalling/whep_session";
import { WebRtcTransport } from "../../src/transport/webrtc/webrtc_transport";
import { PendingConnection } from "../../src/transport/webrtc/pending_connection";
import type { Transport, TransportEvents } from "../../src/transport/transport";

/** The far side of a transport, as a test plays it. */
interface FarSide {
  readonly transport: Transport;
  readonly sent: readonly string[];
  readonly isClosed: () => boolean;
  say(text: string): void;
  holdBack(bytes: number): void; // so much waits to be sent
  hangUp(): void;
}

class FakeChannel {
  readyState = "open";
  bufferedAmount = 0;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  onclose: (() => void) | null = null;
  constructor(
    readonly label: string,
    private readonly sent: string[],
  ) {}
  send(text: string): void {
    this.sent.push(text);
  }
}

class FakeConnection {
  static newest: FakeConnection;
  readonly channels: FakeChannel[] = [];
  readonly sent: string[] = [];
  connectionState = "connected";
  constructor() {
    FakeConnection.newest = this;
  }
  createDataChannel(label: string): FakeChannel {
    const channel = new FakeChannel(label, this.sent);
    this.channels.push(channel);
    return channel;
  }
  close(): void {
    this.connectionState = "closed";
    for (const channel of this.channels) channel.readyState = "closed";
  }
}

const THERE = '{"type":"note","text":"there"}';
const LATE = '{"type":"note","text":"late"}';
const NOW = '{"type":"note","text":"now"}';

const API: WhepApi = {
  end: () => Promise.resolve(),
  media: () => expect.unreachable(),
  offer: () => expect.unreachable(),
  restart: () => expect.unreachable(),
  trickle: () => expect.unreachable(),
};

function webRtc(events: TransportEvents): FarSide {
  const options = { trailer: false, turnOnly: false };
  const transport = new WebRtcTransport(API, new PendingConnection(null, options), options, events);
  transport.listen();
  const { newest } = FakeConnection;
  const session = newest.channels.find(({ label }) => label === "session");
  return {
    transport,
    sent: newest.sent,
    isClosed: () => newest.connectionState === "closed",
    say: (text) => session?.onmessage?.({ data: text }),
    holdBack: (bytes) => newest.channels.forEach((each) => (each.bufferedAmount = bytes)),
    hangUp: () => newest.channels.forEach((each) => each.onclose?.()),
  };
}

function webSocket(events: TransportEvents): FarSide {
  const sent: string[] = [];
  const socket = {
    readyState: 1,
    bufferedAmount: 0,
    onmessage: null as ((event: { data: unknown }) => void) | null,
    onclose: null as (() => void) | null,
    send: (text: string) => void sent.push(text),
    close: () => void (socket.readyState = 3),
  };
  const transport = new WebSocketTransport(socket as unknown as Socket, events);
  const { onclose } = socket;
  return {
    transport,
    sent,
    isClosed: () => socket.readyState === 3,
    say: (text) => socket.onmessage?.({ data: text }),
    holdBack: (bytes) => (socket.bufferedAmount = bytes),
    hangUp: () => onclose?.(),
  };
}

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal("RTCPeerConnection", FakeConnection);
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

describe.each([
  { name: "WebRTC", open: webRtc, isReliable: false },
  { name: "WebSocket", open: webSocket, isReliable: true },
])("a transport by $name", ({ open, isReliable }) => {
  const heard: unknown[] = [];
  const ends: string[] = [];
  let far: FarSide;

  beforeEach(() => {
    heard.length = ends.length = 0;
    far = open({
      message: (channel, data, at) => heard.push([channel, data, at]),
      troubled: () => expect.unreachable(),
      ended: ({ why, detail }) => ends.push(`${why}: ${detail}`),
    });
  });

  it("is connected, and says whether a message can be lost", () => {
    expect(far.transport).toMatchObject({ isConnected: true, isReliable });
  });

  it("carries messages as they are, with the time at which they came", () => {
    expect(far.transport.send("session", THERE)).toBe(true);
    far.say("back");
    expect(far.sent).toEqual([THERE]);
    expect(heard).toEqual([["session", "back", performance.now()]]);
  });

  it("keeps nothing that would wait behind much", () => {
    far.holdBack(200_000);
    expect(far.transport.send("control", LATE)).toBe(false);
    far.holdBack(0);
    expect(far.transport.send("control", NOW)).toBe(true);
    expect(far.sent).toEqual([NOW]);
  });

  it("ends once when the console hangs up, and is closed then", () => {
    far.hangUp();
    far.hangUp();
    expect(ends).toEqual(["lost: the console closed the connection"]);
    expect(far.isClosed()).toBe(true);
    expect(far.transport.send("stop", LATE)).toBe(false);
  });

  it("says nothing of its end when it is closed from here, however often", () => {
    far.transport.close();
    far.transport.close();
    far.hangUp();
    vi.runAllTimers();
    expect(ends).toEqual([]);
    expect(far.isClosed()).toBe(true);
  });
});
