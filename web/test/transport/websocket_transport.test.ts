import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { ConsoleError } from "../../src/transport/signalling/console_api";
import type { TransportEvents } from "../../src/transport/transport";
import {
  openWebSocketTransport,
  WebSocketTransport,
  type WebSocketApi,
  type Socket,
} from "../../src/transport/websocket_transport";

const PING = '{"type":"ping","id":3}';
const NOTE = '{"type":"note","text":"seen"}';

class FakeSocket {
  readyState = 0;
  bufferedAmount = 0;
  sent: string[] = [];
  closed = false;
  onopen: (() => void) | null = null;
  onclose: (() => void) | null = null;
  onerror: (() => void) | null = null;
  onmessage: ((event: { data: unknown }) => void) | null = null;

  send(text: string): void {
    this.sent.push(text);
  }

  close(): void {
    this.closed = true;
    this.readyState = 3;
  }

  open(): void {
    this.readyState = 1;
    this.onopen?.();
  }

  get asSocket(): Socket {
    return this as unknown as Socket;
  }
}

class FakeApi implements WebSocketApi {
  declined: string[] = [];

  constructor(private readonly error: ConsoleError | null = null) {}

  watch(relay: string): Promise<string> {
    return this.error === null ? Promise.resolve(`ticket-${relay}`) : Promise.reject(this.error);
  }

  declineLine(ticket: string): Promise<void> {
    this.declined.push(ticket);
    return Promise.resolve();
  }

  lineAddress(ticket: string): string {
    return `wss://console/robots/left/watch/${ticket}`;
  }
}

function listener(): TransportEvents & { heard: unknown[]; ends: string[] } {
  const heard: unknown[] = [];
  const ends: string[] = [];
  return {
    heard,
    ends,
    message: (_channel, data) => void heard.push(data),
    troubled: () => expect.unreachable(),
    ended: ({ why }) => void ends.push(why),
  };
}

const never = new AbortController().signal;

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

describe("opening a WebSocket", () => {
  it("opens the address that the ticket stands in", async () => {
    const socket = new FakeSocket();
    const addresses: string[] = [];
    const opening = openWebSocketTransport(new FakeApi(), "1", never, listener(), (url) => {
      addresses.push(url);
      queueMicrotask(() => socket.open());
      return socket.asSocket;
    });
    expect(await opening).toBeInstanceOf(WebSocketTransport);
    expect(addresses).toEqual(["wss://console/robots/left/watch/ticket-1"]);
  });

  it("gives the ticket back where no WebSocket passes", async () => {
    for (const fail of [
      (socket: FakeSocket) => socket.onerror?.(),
      (socket: FakeSocket) => socket.onclose?.(),
      () => {
        throw new Error("a policy forbids it");
      },
    ]) {
      const api = new FakeApi();
      const socket = new FakeSocket();
      const events = listener();
      const opening = openWebSocketTransport(api, "0", never, events, () => {
        if (fail.length === 0) fail(socket);
        else queueMicrotask(() => fail(socket));
        return socket.asSocket;
      });
      expect(await opening).toBeNull();
      expect(api.declined).toEqual(["ticket-0"]);
      expect(events.ends).toEqual([]);
    }
  });

  it("waits for a proxy that says nothing only so long", async () => {
    vi.useRealTimers(); // AbortSignal.timeout is the engine's own
    const limit = new AbortController();
    const socket = new FakeSocket();
    const api = new FakeApi();
    const opening = openWebSocketTransport(api, "0", limit.signal, listener(), () => {
      queueMicrotask(() => limit.abort());
      return socket.asSocket;
    });
    expect(await opening).toBeNull();
    expect(socket.closed).toBe(true);
    expect(api.declined).toEqual(["ticket-0"]);
  });

  it("does without at a console that knows no such WebSocket, and passes every other refusal on", async () => {
    const unused = (): Socket => expect.unreachable();
    for (const status of [404, 405]) {
      const api = new FakeApi(new ConsoleError(status, "not_found", "", null));
      expect(await openWebSocketTransport(api, "0", never, listener(), unused)).toBeNull();
    }
    for (const name of ["too_many_peers", "link_revoked", "console_unreachable"]) {
      const api = new FakeApi(new ConsoleError(503, name, "", 5000));
      await expect(openWebSocketTransport(api, "0", never, listener(), unused)).rejects.toMatchObject({
        error: name,
      });
    }
  });
});

describe("a WebSocket for messages", () => {
  function open(): {
    socket: FakeSocket;
    transport: WebSocketTransport;
    events: ReturnType<typeof listener>;
  } {
    const socket = new FakeSocket();
    socket.readyState = 1;
    const events = listener();
    return { socket, transport: new WebSocketTransport(socket.asSocket, events), events };
  }

  it("carries messages as they are", () => {
    const { socket, transport, events } = open();
    expect(transport.send("session", NOTE)).toBe(true);
    socket.onmessage?.({ data: '{"type":"pong","id":3}' });
    expect(socket.sent).toEqual([NOTE]);
    expect(events.heard).toEqual(['{"type":"pong","id":3}']);
  });

  it("takes nothing that would wait long, and nothing after its end", () => {
    const { socket, transport } = open();
    socket.bufferedAmount = 200_000;
    expect(transport.send("session", NOTE)).toBe(false);
    socket.bufferedAmount = 0;
    transport.close();
    expect(transport.send("session", NOTE)).toBe(false);
    expect(socket.sent).toEqual([]);
  });

  it("ends once when the console closes it", () => {
    const { socket, transport, events } = open();
    const { onclose } = socket;
    onclose?.();
    onclose?.();
    transport.close();
    expect(events.ends).toEqual(["lost"]);
  });

  it("ends when a ping is not answered, and whatever is heard is an answer", () => {
    const { socket, transport, events } = open();
    transport.send("session", PING);
    vi.advanceTimersByTime(4900);
    socket.onmessage?.({ data: "anything" });
    vi.advanceTimersByTime(60_000);
    expect(events.ends).toEqual([]);
    transport.probe();
    vi.advanceTimersByTime(6000);
    expect(events.ends).toEqual(["silent"]);
    expect(socket.closed).toBe(true);
  });

  it("waits for no answer to what is not answered", () => {
    const { transport, events } = open();
    transport.send("session", NOTE);
    vi.advanceTimersByTime(60_000);
    expect(events.ends).toEqual([]);
  });

  it("says nothing of its end when it is closed from here", () => {
    const { socket, transport, events } = open();
    transport.send("session", PING);
    transport.close();
    socket.onclose?.();
    vi.advanceTimersByTime(60_000);
    expect(events.ends).toEqual([]);
  });
});
