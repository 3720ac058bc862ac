import { CAMERA } from "./chunk";
import { clampedEvent, grownIndex, timeOf, type ReplayIndex, type ReplayMark } from "./index_table";
import type { ReplayMoment, ReplayPlace } from "./moment";
import { eventAfter, isNewer, MAX_EVENT } from "../gate/serial";
import { ConsoleError } from "../transport/signalling/console_api";
import type { RobotDescription } from "../protocol/wire";
import { ChunkCache } from "./chunk_cache";
import { MomentLoader } from "./moment_loader";
import { CannotDecode, PictureDecoder } from "./picture_decoder";
import type { RecordingDetails, RecordingsApi } from "./recordings_api";
import { microphonesOf, SoundPlayer } from "./sound_player";

const FOLLOW_MS = 2000;
const MOST_FOLLOW_MS = 30_000; // between two tries while the console does not answer
const DAMAGED = "This part of the recording is damaged";
const US = 1e6;

/** What stands on screen: one moment with its pictures. */
export interface ShownMoment {
  readonly moment: ReplayMoment;
  readonly pictures: ReadonlyMap<string, VideoFrame>; // by topic; they stay the decoders'
  readonly troubles: ReadonlyMap<string, string>; // why there is no picture, by topic
}

export interface PlayerEvents {
  shown(shown: ShownMoment): void; // all of one event at once
  changed(): void; // everything else that the page shows
}

/** Plays one recording. Everything it shows together belongs to one event. */
export class Player {
  readonly cameras: readonly string[]; // topics
  description: RobotDescription | null;
  index: ReplayIndex;
  isRunning: boolean; // it is still being recorded
  isPlaying = false;
  isLoading = false;
  follows = false; // stays at the newest event
  speed = 1;
  loop: { readonly from: number; readonly to: number } | null = null; // events
  place: ReplayPlace;
  shown: ShownMoment | null = null;
  trouble: unknown = null; // of the last request
  isGone = false; // it was deleted meanwhile: what is loaded can still be looked at
  private followMs = FOLLOW_MS;
  private readonly store: ChunkCache;
  private readonly loader: MomentLoader;
  private readonly sound: SoundPlayer;
  private readonly decoders = new Map<string, PictureDecoder>();
  private working: Promise<void> | null = null;
  private wanted: ReplayPlace | null = null;
  private followTimer: ReturnType<typeof setTimeout> | undefined;
  private closed = false;

  constructor(
    private readonly api: RecordingsApi,
    private readonly details: RecordingDetails,
    private readonly events: PlayerEvents,
  ) {
    this.index = details.index;
    this.description = details.description;
    this.isRunning = details.entry.running;
    this.cameras = this.index.topics.filter((topic) => topic.startsWith(CAMERA));
    this.place = { event: this.index.firstEvent, until: null };
    this.store = new ChunkCache((number, signal) => api.chunk(details.entry.id, number, signal));
    this.loader = new MomentLoader(this.store);
    this.sound = new SoundPlayer(this.store, microphonesOf(this.index));
    if (this.isRunning) this.followLater();
  }

  /** Shows an event, as soon as it can; of several asked for meanwhile the last one. */
  seek(event: number, until: number | null = null): Promise<void> {
    this.pause();
    this.follows = false;
    return this.show({ event: clampedEvent(this.index, event), until });
  }

  step(events: 1 | -1): Promise<void> {
    const { event } = this.place;
    return this.seek(events === 1 ? eventAfter(event) : event > 1 ? event - 1 : MAX_EVENT);
  }

  /** To the next or the one before of these marks. */
  jump(marks: readonly ReplayMark[], direction: 1 | -1): void {
    const here =
      this.place.until ?? (direction === 1 ? (this.shown?.moment.feedback?.arrived ?? 0) : this.timeHere());
    const found =
      direction === 1 ? marks.find((mark) => mark.time > here) : marks.findLast((mark) => mark.time < here);
    if (found !== undefined) void this.seekMark(found);
  }

  seekMark(mark: ReplayMark): Promise<void> {
    return this.seek(mark.event, mark.time);
  }

  toNewest(): void {
    this.pause();
    this.follows = true;
    void this.show({ event: this.index.lastEvent, until: null });
  }

  play(): void {
    if (this.isPlaying || this.index.lastEvent === 0) return;
    this.isPlaying = true;
    this.follows = false;
    void this.run();
  }

  pause(): void {
    this.isPlaying = false;
    this.events.changed();
  }

  /** What could not be read: parts that are damaged, and requests that failed. */
  get troubles(): { readonly damaged: number; readonly failed: number } {
    return { damaged: this.store.damaged.size, failed: this.store.failed };
  }

  private isOpen(): boolean {
    return !this.closed;
  }

  /** A setting was changed from outside. */
  changed(): void {
    this.events.changed();
  }

  /** The loop with one of its ends moved; the other end goes along where it would be on the wrong side. */
  loopWith(edge: "from" | "to", event: number): { readonly from: number; readonly to: number } {
    const { from, to } = this.loop ?? { from: this.index.firstEvent, to: this.index.lastEvent };
    if (edge === "from") return { from: event, to: isNewer(event, to) ? this.index.lastEvent : to };
    return { from: isNewer(from, event) ? this.index.firstEvent : from, to: event };
  }

  close(): void {
    this.closed = true;
    this.isPlaying = false;
    clearTimeout(this.followTimer);
    this.sound.stop();
    this.store.close();
    for (const decoder of this.decoders.values()) decoder.close();
  }

  private timeHere(): number {
    return this.place.until ?? this.shown?.moment.feedback?.arrived ?? timeOf(this.index, this.place.event);
  }

  /** By the console's clock, event by event as they came. */
  private async run(): Promise<void> {
    const { index } = this;
    if (!isNewer(index.lastEvent, this.place.event) && this.timeHere() >= index.ended - 0.2 * US)
      await this.show({ event: this.loop?.from ?? index.firstEvent, until: null });
    let time = this.timeHere();
    let before = performance.now();
    while (this.playsOn()) {
      const now = await nextFrame();
      time += (now - before) * 1000 * this.speed;
      before = now;
      const event = await this.eventAt(time);
      if (event === null || !this.playsOn()) continue;
      if (time > this.index.ended || (this.loop !== null && isNewer(event, this.loop.to))) {
        if (this.loop === null) this.isPlaying = false;
        this.sound.stop();
        await this.show({ event: this.loop?.from ?? this.index.lastEvent, until: null });
        time = this.timeHere();
        before = performance.now();
        continue;
      }
      if (this.speed === 1)
        this.sound.follow(this.index, time).catch(() => undefined); // pictures go on without
      else this.sound.stop();
      const asked = performance.now();
      await this.show({ event, until: time });
      if (performance.now() - asked > 250) before = performance.now(); // what loads does not run away
    }
    this.sound.stop();
    this.events.changed();
  }

  private playsOn(): boolean {
    return this.isPlaying && !this.closed;
  }

  private async eventAt(time: number): Promise<number | null> {
    try {
      return await this.loader.eventAt(this.index, time);
    } catch (error) {
      this.fail(error);
      this.isPlaying = false;
      return null;
    }
  }

  private show(place: ReplayPlace): Promise<void> {
    this.wanted = place;
    this.place = place;
    this.events.changed();
    this.working ??= this.work().finally(() => (this.working = null));
    return this.working;
  }

  private async work(): Promise<void> {
    while (this.wanted !== null && this.isOpen()) {
      const place = this.wanted;
      this.wanted = null;
      this.isLoading = true;
      try {
        const shown = await this.prepare(place);
        this.trouble = null;
        this.shown = shown;
        this.events.shown(shown);
      } catch (error) {
        if (this.isOpen()) this.fail(error);
        this.isPlaying = false;
      }
    }
    this.isLoading = false;
    this.events.changed();
  }

  private async prepare(place: ReplayPlace): Promise<ShownMoment> {
    const moment = await this.loader.load(this.index, place);
    const pictures = new Map<string, VideoFrame>();
    const troubles = new Map<string, string>();
    await Promise.all(
      this.cameras.map(async (topic) => {
        const picture = moment.pictures.get(topic);
        if (picture === undefined) {
          troubles.set(topic, moment.damaged ? DAMAGED : "No picture had arrived yet");
          return;
        }
        try {
          pictures.set(topic, await this.decoder(topic).decode(picture));
        } catch (error) {
          if (!(error instanceof CannotDecode)) throw error;
          troubles.set(topic, error.message);
        }
      }),
    );
    return { moment, pictures, troubles };
  }

  /** A file that was deleted comes no more; everything else is asked for again when it is needed. */
  private fail(error: unknown): void {
    this.trouble = error;
    if (!(error instanceof ConsoleError) || error.status !== 404) return;
    this.isGone = true;
    this.isRunning = this.follows = false;
  }

  private decoder(topic: string): PictureDecoder {
    const found = this.decoders.get(topic) ?? new PictureDecoder();
    this.decoders.set(topic, found);
    return found;
  }

  private followLater(): void {
    if (!this.closed && this.isRunning)
      this.followTimer = setTimeout(() => void this.follow(), this.followMs);
  }

  /** What was recorded meanwhile. */
  private async follow(): Promise<void> {
    const from = this.index.chunks.length;
    try {
      const more = await this.api.details(this.details.entry.id, from);
      this.index = grownIndex(this.index, more.index, from);
      this.description ??= more.description;
      this.isRunning = more.entry.running;
      const failed = this.trouble !== null;
      this.trouble = null;
      this.followMs = FOLLOW_MS;
      if (this.follows && !this.isPlaying) await this.show({ event: this.index.lastEvent, until: null });
      else if (failed && this.shown?.moment.place !== this.place) await this.show(this.place);
    } catch (error) {
      this.fail(error);
      this.followMs = Math.min(MOST_FOLLOW_MS, 2 * this.followMs);
    }
    this.events.changed();
    this.followLater();
  }
}

function nextFrame(): Promise<number> {
  return new Promise((resolve) => requestAnimationFrame(resolve));
}
