import type { FleetRobot } from "../fleet_status";
import { isOwnOrigin } from "../robot_pages";
import { giveSlots, THUMBNAIL_LIMIT, type SlotCandidate } from "../thumbnail_slots";
import { AudioDevice } from "../../media/sound/audio_device";
import { ConsoleApi } from "../../transport/signalling/console_api";
import type { PeerOptions } from "../../transport/peer";
import { StampReader } from "../../transport/encoded_transform/stamp_reader";
import { Thumbnail } from "./thumbnail";
import type { Tile } from "./tile";

/** Live pictures for the tiles in view: opened, given to others and closed. */
export class Thumbnails {
  readonly open = new Map<string, Thumbnail>();
  private readonly reader = StampReader.isSupported() ? new StampReader() : null;
  private readonly silence = new AudioDevice();
  private readonly inView = new Map<Element, number>(); // since when
  private readonly observer = new IntersectionObserver((entries) => this.looked(entries), { threshold: 0.3 });

  constructor(
    private readonly token: string,
    private readonly options: PeerOptions,
  ) {}

  /** From now on it may get a picture while it is in view. */
  watch(tile: Tile): void {
    this.observer.observe(tile.canvas);
  }

  forget(tile: Tile): void {
    this.observer.unobserve(tile.canvas);
    this.inView.delete(tile.canvas);
    this.end(tile.name);
  }

  /** To be called many times a second. `tiles`: in the order of the page. */
  step(tiles: readonly Tile[], now: number): void {
    const given = giveSlots(
      tiles.map((tile) => this.candidate(tile, now)),
      !document.hidden,
      now,
    );
    for (const name of [...this.open.keys()]) if (!given.has(name)) this.end(name);
    for (const tile of tiles) if (given.has(tile.name) && !this.open.has(tile.name)) this.begin(tile);
    for (const thumbnail of this.open.values()) thumbnail.step(now);
    for (const tile of tiles) this.tell(tile);
  }

  stop(reason: string, press: string): void {
    for (const thumbnail of this.open.values()) thumbnail.stop(reason, press);
  }

  alarm(): void {
    for (const thumbnail of this.open.values()) thumbnail.alarm();
  }

  /** All of them, as before the page is left; `step` opens them again. */
  endAll(): void {
    for (const name of [...this.open.keys()]) this.end(name);
  }

  close(): void {
    this.endAll();
    this.observer.disconnect();
    this.reader?.close();
  }

  private candidate(tile: Tile, now: number): SlotCandidate {
    const thumbnail = this.open.get(tile.name);
    return {
      name: tile.name,
      inViewMs: this.inView.get(tile.canvas) ?? null,
      possible: tile.robot !== null && tile.robot.link === "up" && this.obstacle(tile.robot) === null,
      isOpen: thumbnail !== undefined,
      isOpening: thumbnail?.isOpening(now) ?? false,
      attention: tile.hasAttention(),
    };
  }

  /** Why no picture of this robot can be shown here, whoever is in view; null when one can. */
  private obstacle(robot: FleetRobot): string | null {
    if (this.reader === null) return "This browser cannot read stamps";
    if (!robot.hasPicture) return "No camera";
    return isOwnOrigin(robot.url, document.baseURI) ? null : "Its picture is on its own console";
  }

  private tell(tile: Tile): void {
    tile.thumbnail = this.open.get(tile.name) ?? null;
    const waits =
      this.open.size < THUMBNAIL_LIMIT ? "Connecting …" : `Paused: ${THUMBNAIL_LIMIT} are live. Point here`;
    const obstacle = tile.robot === null ? waits : this.obstacle(tile.robot);
    tile.instead = tile.thumbnail === null ? (obstacle ?? waits) : null;
  }

  private begin(tile: Tile): void {
    const api = new ConsoleApi(this.token, tile.robot?.url ?? "./");
    const changed = (): void => tile.showPicture(performance.now());
    const thumbnail = new Thumbnail(api, this.reader, this.silence, this.options, tile.canvas, changed);
    this.open.set(tile.name, thumbnail);
  }

  private end(name: string): void {
    this.open.get(name)?.close();
    this.open.delete(name);
  }

  private looked(entries: readonly IntersectionObserverEntry[]): void {
    for (const { target, isIntersecting } of entries)
      if (!isIntersecting) this.inView.delete(target);
      else if (!this.inView.has(target)) this.inView.set(target, performance.now());
  }
}
