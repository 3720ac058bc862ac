import { beforeEach, expect, test, vi } from "vitest";
import { PendingConnection } from "../../../src/transport/webrtc/pending_connection";
import type { IceServer } from "../../../src/transport/signalling/ice_servers";

interface Heard {
  readonly channel: string;
  readonly data: unknown;
  readonly at: number;
}

class FakeChannel {
  onmessage: ((event: { data: unknown }) => void) | null = null;
  constructor(
    readonly label: string,
    readonly options: RTCDataChannelInit,
  ) {}
}

class FakeConnection {
  static newest: FakeConnection;
  readonly channels: FakeChannel[] = [];
  readonly calls: string[] = [];
  constructor(readonly configuration: RTCConfiguration) {
    FakeConnection.newest = this;
  }
  createDataChannel(label: string, options: RTCDataChannelInit): FakeChannel {
    const channel = new FakeChannel(label, options);
    this.channels.push(channel);
    return channel;
  }
  createOffer(): Promise<RTCSessionDescriptionInit> {
    return Promise.resolve({ type: "offer", sdp: "v=0\r\nm=application 9 X\r\n" });
  }
  setConfiguration({ iceServers = [] }: RTCConfiguration): void {
    this.calls.push(`servers ${iceServers.length}`);
  }
  setLocalDescription({ type, sdp = "" }: RTCSessionDescriptionInit): Promise<void> {
    this.calls.push(`local ${type} ${sdp.includes("dcmap") ? "changed" : "as made"}`);
    return Promise.resolve();
  }
  setRemoteDescription({ type }: RTCSessionDescriptionInit): Promise<void> {
    this.calls.push(`remote ${type}`);
    return Promise.resolve();
  }
  close(): void {
    this.calls.push("closed");
  }
}

const PLAIN = { trailer: false, turnOnly: false };
const TURN: IceServer = { urls: ["turn:a"], username: "b", credential: "c" };

beforeEach(() => vi.stubGlobal("RTCPeerConnection", FakeConnection));

function say(label: string, data: unknown): void {
  FakeConnection.newest.channels.find((each) => each.label === label)?.onmessage?.({ data });
}

function opened(): { opening: PendingConnection; heard: Heard[] } {
  const heard: Heard[] = [];
  return { opening: new PendingConnection(null, PLAIN), heard };
}

test("the channels are agreed on, so that none waits for a message that opens it", () => {
  opened();
  const { channels } = FakeConnection.newest;
  expect(channels.map(({ label, options }) => [label, options.negotiated, options.id])).toEqual([
    ["control", true, 0],
    ["session", true, 1],
    ["stop", true, 2],
  ]);
});

test("the offer that is posted names the channels, and the browser's own stays as it made it", async () => {
  const { opening } = opened();
  const { sdp, query } = await opening.offer();
  expect(sdp).toContain('a=dcmap:0 label="control"');
  expect(query).toBe("");
  expect(FakeConnection.newest.calls).toEqual([]);
  await opening.take({ sdp: "", servers: [TURN] });
  expect(FakeConnection.newest.calls).toEqual(["servers 1", "local offer as made", "remote answer"]);
});

test("what comes before anybody listens is heard then, in order and with the time at which it came", () => {
  const { opening, heard } = opened();
  const before = performance.now();
  say("session", "welcome");
  say("control", "feedback");
  const after = performance.now();
  opening.listen((channel, data, at) => heard.push({ channel, data, at }));
  say("stop", "stopped");
  expect(heard.map(({ channel, data }) => [channel, data])).toEqual([
    ["session", "welcome"],
    ["control", "feedback"],
    ["stop", "stopped"],
  ]);
  for (const { at } of heard.slice(0, 2)) {
    expect(at).toBeGreaterThanOrEqual(before);
    expect(at).toBeLessThanOrEqual(after);
  }
});

test("of feedback that nobody takes the newest is kept, and nothing else is lost for it", () => {
  const { opening, heard } = opened();
  say("session", "welcome");
  for (let number = 1; number <= 200; number += 1) say("control", number);
  opening.listen((channel, data, at) => heard.push({ channel, data, at }));
  expect(heard[0]?.data).toBe("welcome");
  expect(heard).toHaveLength(65);
  expect(heard.at(-1)?.data).toBe(200);
});

test("more of what all counts than there can be ends the connection instead of growing", () => {
  const { opening, heard } = opened();
  for (let number = 0; number <= 1000; number += 1) say("session", number);
  expect(FakeConnection.newest.calls).toContain("closed");
  opening.listen((channel, data, at) => heard.push({ channel, data, at }));
  expect(heard).toEqual([]);
});

test("a link that asks for a relay goes through one or not at all", () => {
  new PendingConnection(null, { ...PLAIN, turnOnly: true });
  expect(FakeConnection.newest.configuration.iceTransportPolicy).toBe("relay");
});
