import type { ConnectionErrorKind } from "./connection_error";
import type { ChannelName } from "./webrtc/data_channels";

/** How a transport ended. */
export class TransportEnd extends Error {
  constructor(
    readonly why: ConnectionErrorKind,
    readonly detail: string,
  ) {
    super(detail);
  }
}

export interface TransportEvents {
  message(channel: ChannelName, data: unknown, at: number): void; // `at`: when it came, by performance.now()
  troubled(): void; // it misses the other side
  ended(end: TransportEnd): void; // once, unless closed from here
}

/**
 * A connection for messages, by WebRTC or by WebSocket. It ends once; connecting again makes a new one. The Python
 * client's is lockstep/client/transport/transport.py, the console's lockstep/server/peers/transport.py.
 */
export interface Transport {
  readonly isConnected: boolean; // true from its first connection on
  readonly isReliable: boolean; // no message is lost on the way

  /** Returns whether the message could be sent. What cannot go out now is not kept: newer follows. */
  send(channel: ChannelName, text: string): boolean;

  /** Asks whether the other side still hears, as after a change of networks. */
  probe(): void;

  /** Moves to another path where it can; everything else lives on. Raises ConsoleError when the console refuses. */
  restart(): Promise<void>;

  /** Ends it. Idempotent. */
  close(): void;
}
