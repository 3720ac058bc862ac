/** Which transport a connection takes, and where its pictures come from. */
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Peer } from "../../src/transport/peer";
import { ConsoleError, type ConsoleApi } from "../../src/transport/signalling/console_api";
import type { TransportEnd } from "../../src/transport/transport";

class FakeChannel {
  readyState = "connecting";
  bufferedAmount = 0;
  onclose: (() => void) | null = null;
}

class FakeConnection {
  static newest: FakeConnection;
  connectionState = "new";
  iceGatheringState = "new";
  localDescription = null;
  readonly servers: number[] = [];
  constructor() {
    FakeConnection.newest = this;
  }
  createDataChannel(): FakeChannel {
    return new FakeChannel();
  }
  createOffer(): Promise<RTCSessionDescriptionInit> {
    return Promise.resolve({ type: "offer", sdp: "v=0\r\nm=application 9 X\r\n" });
  }
  setConfiguration({ iceServers = [] }: RTCConfiguration): void {
    if (this.connectionState === "closed") throw new Error("InvalidStateError");
    this.servers.push(iceServers.length);
  }
  setLocalDescription(): Promise<void> {
    return Promise.resolve();
  }
  setRemoteDescription(): Promise<void> {
    return Promise.resolve();
  }
  close(): void {
    this.connectionState = "closed";
  }
}

class FakeSocket {
  static newest: FakeSocket | null = null;
  static passes = true;
  readyState = 0;
  bufferedAmount = 0;
  readonly sent: string[] = [];
  onopen: (() => void) | null = null;
  onerror: (() => void) | null = null;
  onclose: (() => void) | null = null;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  constructor() {
    FakeSocket.newest = this;
    queueMicrotask(() => {
      this.readyState = FakeSocket.passes ? 1 : 3;
      if (FakeSocket.passes) this.onopen?.();
      else this.onerror?.();
    });
  }
  send(text: string): void {
    this.sent.push(text);
  }
  close(): void {
    this.readyState = 3;
  }
}

const RELAY = {
  relay: { engine: "janus", relay: "0", url: "wss://janus", room: 1, feed: 2, pin: "", streams: [] },
};
const HELLO = '{"type":"rename","name":"Ada"}';
const TURN = { urls: ["turn:a"], username: "b", credential: "c" };

interface Far {
  readonly queries: string[];
  readonly ended: string[]; // sessions that were deleted
  readonly ends: string[];
  readonly peer: Peer;
}

function observer(): Far {
  const queries: string[] = [];
  const ended: string[] = [];
  const ends: string[] = [];
  const api = {
    relay: () => Promise.resolve(RELAY),
    watch: () => Promise.resolve("ticket"),
    declineLine: () => Promise.resolve(),
    lineAddress: () => "wss://console/watch/ticket",
    iceServers: () => Promise.resolve([TURN]),
    offer: (_sdp: string, query: string) => {
      queries.push(query);
      return Promise.resolve({ sdp: "", location: "/whep/7", tag: "t", servers: [TURN] });
    },
    end: (location: string) => {
      if (location !== "") ended.push(location);
      return Promise.resolve();
    },
  };
  const events = {
    message: () => undefined,
    troubled: () => undefined,
    streams: () => undefined,
    ended: ({ why }: TransportEnd) => ends.push(why),
  };
  const options = { trailer: false, turnOnly: false, watches: true };
  const peer = new Peer(api as unknown as ConsoleApi, null, options, events);
  return { queries, ended, ends, peer };
}

beforeEach(() => {
  FakeSocket.newest = null;
  FakeSocket.passes = true;
  vi.stubGlobal("RTCPeerConnection", FakeConnection);
  vi.stubGlobal("WebSocket", FakeSocket);
  vi.stubGlobal("document", { baseURI: "https://console/" });
});
afterEach(() => vi.unstubAllGlobals());

test("an observer behind a relay has a WebSocket, and no WebRTC connection to the console", async () => {
  const { peer, queries, ended, ends } = observer();
  await peer.connect();
  expect(peer).toMatchObject({ isConnected: true, isReliable: true, isRelayed: true });
  expect(FakeConnection.newest.connectionState).toBe("closed");
  expect(peer.send("session", HELLO)).toBe(true);
  expect(FakeSocket.newest?.sent).toEqual([HELLO]);
  await peer.refresh(); // its relay takes the servers; the closed connection is left alone
  await peer.restart(); // TCP cannot move: it asks
  expect(FakeSocket.newest?.sent).toEqual([HELLO, '{"type":"ping","id":0}']);
  peer.close();
  expect([FakeSocket.newest?.readyState, queries, ended, ends]).toEqual([3, [], [], []]);
});

test("where no WebSocket passes the messages go by data channels, and pictures come from the relay all the same", async () => {
  FakeSocket.passes = false;
  const { peer, queries, ended } = observer();
  await peer.connect();
  expect(queries).toEqual(["relay=0"]);
  expect(peer).toMatchObject({ isConnected: false, isReliable: false, isRelayed: true });
  peer.close();
  expect(ended).toEqual(["/whep/7"]);
});

test("an observer closed while its WebSocket opens leaves none open", async () => {
  const { peer } = observer();
  const connecting = peer.connect().catch((error: unknown) => error);
  await vi.waitFor(() => expect(FakeSocket.newest).not.toBeNull());
  peer.close();
  await connecting;
  expect(FakeSocket.newest?.readyState).toBe(3);
  expect(FakeConnection.newest.connectionState).toBe("closed");
});

test("a console that refuses the offer is the connection's error", async () => {
  FakeSocket.passes = false;
  const { peer } = observer();
  const refusal = new ConsoleError(503, "too_many_peers", "", 5000);
  vi.spyOn(FakeConnection.prototype, "createOffer").mockRejectedValue(refusal);
  await expect(peer.connect()).rejects.toBe(refusal);
  peer.close();
});
