import type { ClientMessage } from "../protocol/wire";
import type { DrawnPicture } from "../media/picture_trace";
import type { ChannelName } from "../transport/webrtc/data_channels";
import { TraceBook, slowestEvents } from "./trace_book";

const REPORT_MS = 500;
const GOES_ON_MS = 120_000; // after the charts were closed: on a phone they stand over the pictures, and nobody drives

/** What decides whether traces are worth their bytes. */
export interface TracingEvents {
  tell(channel: ChannelName, message: ClientMessage): boolean;
  isConnected(): boolean;
  drivesRecorded(): boolean; // this page holds the seat, and the session is recorded
  mainStream(): string | null;
}

/** Asks the console for traces while somebody looks at them or a recording keeps them, and keeps the book. */
export class Tracing {
  readonly book = new TraceBook();
  private readonly shownIn = new Set<string>(); // where somebody looks at them now
  private shownMs = -Infinity; // when they were last
  private asked = false;
  private values: readonly (number | null)[] = [];
  private changedMs: number | null = null; // when the intention became one that no command has carried yet
  private reportedMs = 0;

  constructor(private readonly events: TracingEvents) {}

  /** Somebody looks at traces from now on, or no more. */
  show(shown: boolean, now: number, where = "charts"): void {
    if (shown) this.shownIn.add(where);
    else if (this.shownIn.delete(where)) this.shownMs = now;
  }

  /** Another connection knows nothing of what was asked before. */
  connectionClosed(): void {
    this.asked = false;
    this.changedMs = null;
    this.book.forget();
  }

  /** What the operator wants now. The wait of a change begins with the first one that no command has carried. */
  noteIntention(values: readonly (number | null)[], now: number): void {
    if (values.length === this.values.length && values.some((value, at) => value !== this.values[at]))
      this.changedMs ??= now;
    this.values = values;
  }

  noteSent(message: ClientMessage, now: number): void {
    if (message.type !== "command") return;
    this.book.noteSent(message.event, now, this.changedMs === null ? null : now - this.changedMs);
    this.changedMs = null;
  }

  noteDrawn(stream: string, picture: DrawnPicture | null): void {
    if (this.asked && picture !== null) this.book.noteDrawn(stream, picture);
  }

  step(now: number): void {
    if (!this.events.isConnected()) return;
    const recorded = this.events.drivesRecorded();
    const wanted = this.shownIn.size > 0 || now - this.shownMs < GOES_ON_MS || recorded;
    if (wanted !== this.asked && this.events.tell("session", { type: "trace_request", wanted }))
      this.asked = wanted;
    if (recorded && now - this.reportedMs >= REPORT_MS) this.report(now);
  }

  private report(now: number): void {
    const events = slowestEvents(this.book, this.events.mainStream(), this.reportedMs);
    this.reportedMs = now;
    if (events.length > 0) this.events.tell("control", { type: "trace_report", events });
  }
}
