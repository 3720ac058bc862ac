import { setSpan, sumOfSpans } from "../util/span_values";
import { PICTURE_WAY } from "../protocol/ways";
import { BoundedLog } from "../util/bounded_log";
import type { DrawnPicture } from "../media/picture_trace";
import type { CommandSpans, EventTrace, PictureSpans, PictureTrace, Traces } from "../protocol/wire";

/** A picture's whole way, as far as it was measured. */
export interface TracedPicture {
  readonly stream: string;
  readonly stamp: number;
  readonly atMs: number; // performance.now(), when it was drawn
  readonly spans: PictureSpans;
}

/** A command's whole way, as far as it was measured. */
export interface TracedCommand {
  readonly event: number;
  readonly atMs: number; // performance.now(), when its feedback came
  readonly totalMs: number; // from its sending to its feedback
  readonly spans: CommandSpans;
}

/** What this page knows of an event that it sent itself. */
interface SentEvent {
  readonly sentMs: number;
  readonly inputMs: number | null; // that the intention had waited
  answer: { readonly atMs: number; readonly tookMs: number } | null;
  told: CommandSpans | null; // by the console
}

const EVENTS = 128;
const PICTURES = 256; // that wait for the other half of their trace
const LOG = 2400; // two minutes of two cameras
const IN_COMMAND = [
  "forward_ms",
  "link_ms",
  "tick_wait_ms",
  "apply_ms",
  "rate_wait_ms",
  "measure_ms",
  "back_ms",
] as const;
const IN_PICTURE = PICTURE_WAY.map(({ name }) => name).filter((name) => name !== "between_ms");
const UNTIL_FEEDBACK = ["forward_ms", "tick_wait_ms", "apply_ms", "rate_wait_ms", "measure_ms"] as const;

/**
 * Joins what console and bridge say of pictures and commands with what this page has measured, and finds the remainder
 * of each event. Holds no clock, no socket and no DOM; everything in it is bounded.
 */
export class TraceBook {
  readonly pictures = new BoundedLog<TracedPicture>(LOG);
  readonly commands = new BoundedLog<TracedCommand>(LOG);
  private readonly sent = new Map<number, SentEvent>();
  private readonly drawnAlone = new Map<string, DrawnPicture>();
  private readonly toldAlone = new Map<string, PictureTrace>();

  /** Event references of another connection may belong to another epoch. What was traced stays to be looked at. */
  forget(): void {
    for (const waiting of [this.sent, this.drawnAlone, this.toldAlone]) waiting.clear();
  }

  /** A command left for the first time. */
  noteSent(event: number, sentMs: number, inputMs: number | null): void {
    if (!this.sent.has(event)) keep(this.sent, event, { sentMs, inputMs, answer: null, told: null }, EVENTS);
  }

  /** What is sent under its number later is traced anew. */
  noteRefused(event: number): void {
    this.sent.delete(event);
  }

  /** The feedback of an event came at `atMs`, and was taken at `takenMs`; the first one counts. */
  noteAnswered(event: number, atMs: number, takenMs: number): void {
    const known = this.sent.get(event);
    if (known === undefined || known.answer !== null) return;
    known.answer = { atMs, tookMs: takenMs - atMs };
    this.finish(event, known);
  }

  /** This page has drawn a picture. */
  noteDrawn(stream: string, picture: DrawnPicture): void {
    const key = `${stream} ${picture.rtpTimestamp}`;
    const told = this.toldAlone.get(key);
    if (told === undefined) keep(this.drawnAlone, key, picture, PICTURES);
    else this.join(key, told, picture);
  }

  /** The console has told its part. */
  noteTold(traces: Traces): void {
    for (const { event, spans } of traces.commands) {
      const known = this.sent.get(event);
      if (known === undefined || known.told !== null) continue;
      known.told = spans;
      this.finish(event, known);
    }
    for (const told of traces.pictures) {
      const key = `${told.stream} ${told.rtp_time}`;
      const drawn = this.drawnAlone.get(key);
      if (drawn === undefined) keep(this.toldAlone, key, told, PICTURES);
      else this.join(key, told, drawn);
    }
  }

  private join(key: string, told: PictureTrace, drawn: DrawnPicture): void {
    this.drawnAlone.delete(key);
    this.toldAlone.delete(key);
    const spans: Spans<PictureSpans> = { ...told.spans, ...drawn.spans };
    const between = this.betweenOf(told.stamp, spans, drawn.drawnMs);
    if (between !== null) setSpan(spans, "between_ms", between);
    this.pictures.add({ stream: told.stream, stamp: told.stamp, atMs: drawn.drawnMs, spans });
  }

  /**
   * From the command's sending to its picture on the canvas one clock has measured, this page's. What of it is neither
   * the command's way to its feedback nor the picture's from there on lies between the clocks.
   */
  private betweenOf(stamp: number, spans: PictureSpans, drawnMs: number): number | null {
    const known = this.sent.get(stamp);
    if (known?.told === null || known === undefined || spans.camera_wait_ms === undefined) return null;
    const inPicture = sumOfSpans(spans, IN_PICTURE);
    return drawnMs - known.sentMs - sumOfSpans(known.told, UNTIL_FEEDBACK) - inPicture;
  }

  private finish(event: number, { sentMs, inputMs, answer, told }: SentEvent): void {
    if (answer === null || told === null) return;
    const spans: Spans<CommandSpans> = { ...told };
    if (inputMs !== null) setSpan(spans, "input_ms", inputMs);
    setSpan(spans, "take_ms", answer.tookMs);
    setSpan(spans, "between_ms", answer.atMs - sentMs - sumOfSpans(told, IN_COMMAND));
    this.commands.add({ event, atMs: answer.atMs, totalMs: answer.atMs - sentMs, spans });
  }
}

/** The spans of a generated type, to be filled in. */
type Spans<Type> = { -readonly [name in keyof Type]: Type[name] };

function keep<Key, Value>(map: Map<Key, Value>, key: Key, value: Value, limit: number): void {
  map.set(key, value);
  for (const oldest of map.keys()) {
    if (map.size <= limit) break;
    map.delete(oldest);
  }
}

const REPORTED = 4; // events in one report: those that took longest

/** What of the commands that were answered after `sinceMs` a recording should keep: this page's own part. */
export function slowestEvents(book: TraceBook, stream: string | null, sinceMs: number): EventTrace[] {
  const pictures = book.pictures.newest(({ atMs }) => atMs > sinceMs - 1000);
  return book.commands
    .newest(({ atMs }) => atMs > sinceMs)
    .toSorted((left, right) => right.totalMs - left.totalMs)
    .slice(0, REPORTED)
    .map(({ event, spans }) => {
      const picture = pictures.findLast((each) => each.stamp === event && each.stream === stream);
      const command = pick(spans, ["input_ms", "between_ms", "take_ms"] as const);
      if (picture === undefined) return { event, command };
      return { event, command, stream: picture.stream, picture: pick(picture.spans, OF_PAGE) };
    });
}

/** What the console does not record itself: its sending differs from one client to the next. */
const OF_PAGE = [
  "send_ms",
  "assemble_ms",
  "transform_ms",
  "decode_ms",
  "gate_ms",
  "draw_ms",
  "between_ms",
] as const;

function pick<Type extends object, Name extends keyof Type>(
  all: Type,
  names: readonly Name[],
): Pick<Type, Name> {
  return Object.fromEntries(names.flatMap((name) => (name in all ? [[name, all[name]]] : []))) as Pick<
    Type,
    Name
  >;
}
