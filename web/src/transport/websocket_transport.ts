/** An observer's way to the console beside a relay: one WebSocket for all that data channels would carry. */
import { expectsPong } from "./expects_pong";
import { ConsoleError, type ConsoleApi } from "./signalling/console_api";
import { TransportEnd, type Transport, type TransportEvents } from "./transport";
import type { ChannelName } from "./webrtc/data_channels";

const OPEN_MS = 3000; // and so many times what the ticket took: TCP, TLS and the upgrade are round trips too
const OPEN_TRIPS = 6;
const MOST_OPEN_MS = 12_000;
const ANSWER_MS = 5000; // for the console to say anything after a ping
const UNREAD_MS = 500; // more: a page that was held up has answers waiting that it has not read
const MAX_WAITING = 100_000; // bytes
const PROBE = JSON.stringify({ type: "ping", id: 0 }); // nobody waits for its round trip

/** What of the console's interface it needs. */
export type WebSocketApi = Pick<ConsoleApi, "watch" | "declineLine" | "lineAddress">;

export type Socket = Pick<
  WebSocket,
  "bufferedAmount" | "close" | "onclose" | "onerror" | "onmessage" | "onopen" | "readyState" | "send"
>;

const OPEN = 1; // WebSocket.OPEN

/** A WebSocket that is open. */
export class WebSocketTransport implements Transport {
  readonly isConnected = true;
  readonly isReliable = true;
  private answerTimer: ReturnType<typeof setTimeout> | undefined;
  private isOver = false;

  /** `socket` is open. */
  constructor(
    private readonly socket: Socket,
    private readonly events: TransportEvents,
  ) {
    socket.onmessage = (event: MessageEvent<unknown>) => this.received(event.data);
    socket.onclose = () => this.end(new TransportEnd("lost", "the console closed the connection"));
    socket.onerror = null; // onclose follows
  }

  /** The kind of a message tells its channel. */
  send(_channel: ChannelName, text: string): boolean {
    if (this.isOver || this.socket.readyState !== OPEN || this.socket.bufferedAmount > MAX_WAITING)
      return false;
    this.socket.send(text);
    if (expectsPong(text)) this.answerTimer ??= setTimeout(() => this.overdue(), ANSWER_MS);
    return true;
  }

  /** Without an answer it ends. */
  probe(): void {
    this.send("session", PROBE);
  }

  /** TCP has one path: it is asked whether it lives. */
  restart(): Promise<void> {
    this.probe();
    return Promise.resolve();
  }

  close(): void {
    this.isOver = true;
    clearTimeout(this.answerTimer);
    this.socket.onmessage = null;
    this.socket.onclose = null;
    this.socket.close();
  }

  private overdue(): void {
    this.answerTimer = setTimeout(() => this.end(new TransportEnd("silent", "")), UNREAD_MS);
  }

  private received(data: unknown): void {
    clearTimeout(this.answerTimer);
    this.answerTimer = undefined;
    this.events.message("session", data, performance.now());
  }

  private end(end: TransportEnd): void {
    if (this.isOver) return;
    this.close();
    this.events.ended(end);
  }
}

/**
 * Opens a WebSocket to the console, for an observer behind `relay`. null: none passes between here and there, or the
 * console knows none. Raises ConsoleError when the console refuses.
 */
export async function openWebSocketTransport(
  api: WebSocketApi,
  relay: string,
  signal: AbortSignal,
  events: TransportEvents,
  makeSocket: (url: string) => Socket = (url) => new WebSocket(url),
): Promise<WebSocketTransport | null> {
  const askedMs = performance.now();
  const ticket = await ticketOf(api, relay, signal);
  const openMs = Math.round(Math.min(OPEN_MS + OPEN_TRIPS * (performance.now() - askedMs), MOST_OPEN_MS));
  if (ticket === null) return null;
  try {
    const socket = makeSocket(api.lineAddress(ticket));
    await opened(socket, AbortSignal.any([signal, AbortSignal.timeout(openMs)]));
    return new WebSocketTransport(socket, events);
  } catch {
    api.declineLine(ticket).catch(() => undefined); // its end comes by itself
    return null;
  }
}

async function ticketOf(api: WebSocketApi, relay: string, signal: AbortSignal): Promise<string | null> {
  try {
    return await api.watch(relay, signal);
  } catch (error) {
    if (error instanceof ConsoleError && (error.status === 404 || error.status === 405)) return null;
    throw error;
  }
}

/** Raises Error when it does not open. */
async function opened(socket: Socket, signal: AbortSignal): Promise<void> {
  let failed = (): void => undefined;
  try {
    await new Promise<void>((resolve, reject) => {
      failed = () => reject(new Error("the WebSocket does not open"));
      socket.onopen = () => resolve();
      socket.onerror = failed;
      socket.onclose = failed;
      signal.addEventListener("abort", failed);
      if (signal.aborted) failed();
    });
  } catch (error) {
    socket.onopen = socket.onerror = socket.onclose = null;
    socket.close();
    throw error;
  } finally {
    signal.removeEventListener("abort", failed);
  }
}
