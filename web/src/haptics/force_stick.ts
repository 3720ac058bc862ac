import type { HidCollection } from "../force_feedback/hid";
import { EffectManager, type EffectBlocks, type Wanted } from "../force_feedback/effect_manager";
import type { ForceSettings } from "../force_feedback/force_settings";
import { describePid, type PidLayouts } from "../force_feedback/pid_device";
import {
  createNewEffect,
  deviceControl,
  deviceGain,
  managesItsPool,
  readBlockLoad,
} from "../force_feedback/pid_reports";
import type { EffectKind } from "../force_feedback/pid_usages";
import type { Report } from "../force_feedback/report_values";

/** HIDDevice of WebHID, as far as it is used here. */
export interface HidDevice {
  readonly productName: string;
  readonly vendorId: number;
  readonly productId: number;
  readonly collections: readonly HidCollection[];
  readonly opened: boolean;
  open(): Promise<void>;
  close(): Promise<void>;
  sendReport(id: number, data: Uint8Array<ArrayBuffer>): Promise<void>;
  sendFeatureReport(id: number, data: Uint8Array<ArrayBuffer>): Promise<void>;
  receiveFeatureReport(id: number): Promise<DataView>;
}

const LOAD_TRIES = 20; // a device may answer only when it has made room

/** A stick that was not opened, in words for its owner. */
export class StickUnusable extends Error {}

/** One force-feedback stick that is open. Of its writes one is under way at a time, and what is newest is next. */
export class ForceStick {
  private wanted: Wanted | null = null;
  private writing = false;
  private isClosed = false;
  private isGone = false; // it took a report no more

  private constructor(
    readonly device: HidDevice,
    private readonly layouts: PidLayouts,
    private readonly manager: EffectManager,
    private readonly lost: () => void,
  ) {}

  /**
   * Opens a device and makes its effects. `lost`: it took a report no more.
   *
   * Throws StickUnusable with the reason.
   */
  static async open(device: HidDevice, settings: ForceSettings, lost: () => void): Promise<ForceStick> {
    const described = describePid(device.collections);
    if (described.kind === "unusable") throw new StickUnusable(described.why);
    const { layouts } = described;
    try {
      if (!device.opened) await device.open();
      const blocks = await prepare(device, layouts);
      return new ForceStick(device, layouts, new EffectManager(layouts, blocks, settings), lost);
    } catch (error) {
      await device.close().catch(() => undefined);
      if (error instanceof StickUnusable) throw error;
      throw new StickUnusable("it does not answer", { cause: error });
    }
  }

  set settings(settings: ForceSettings) {
    this.manager.settings = settings;
  }

  /** What the hand may feel now; null ends everything. */
  feel(wanted: Wanted | null, now: number): void {
    this.wanted = wanted;
    if (this.writing || this.isClosed || this.isGone) return; // a stick that is slow gets the newest at the next call
    if (wanted !== null || this.manager.isPlaying) void this.write(now);
  }

  /** Ends everything and lets go of the device. */
  async close(): Promise<void> {
    if (this.isClosed) return;
    this.isClosed = true;
    this.wanted = null;
    try {
      for (const report of this.manager.stop()) await send(this.device, report);
      await send(this.device, deviceControl(this.layouts, "stopAllEffects"));
      await send(this.device, deviceControl(this.layouts, "reset"));
    } catch {
      // It is unplugged, or ends its effects by itself.
    }
    await this.device.close().catch(() => undefined);
  }

  private async write(now: number): Promise<void> {
    this.writing = true;
    try {
      const { wanted } = this;
      for (const report of this.manager.step(wanted, now)) {
        if (wanted !== null && this.wanted === null) break; // nothing may be felt any more
        await send(this.device, report);
      }
      if (this.wanted === null) for (const report of this.manager.stop()) await send(this.device, report);
    } catch {
      if (!this.isClosed && !this.isGone) this.lost();
      this.isGone = true;
    } finally {
      this.writing = false;
    }
  }
}

async function prepare(device: HidDevice, layouts: PidLayouts): Promise<EffectBlocks> {
  const { pool } = layouts;
  const answer = pool === null ? null : await receive(device, pool.id);
  if (!managesItsPool(layouts, answer))
    throw new StickUnusable("its host would have to manage its memory, which this page does not do");
  for (const control of ["reset", "enableActuators"] as const)
    await send(device, deviceControl(layouts, control));
  const gain = deviceGain(layouts);
  if (gain !== null) await send(device, gain);
  const constant = await create(device, layouts, "constant");
  if (constant === null) throw new StickUnusable("it has no room for an effect");
  const blocks: Partial<Record<EffectKind, number>> = {};
  for (const kind of layouts.kinds) {
    const block = kind === "constant" ? constant : await create(device, layouts, kind);
    if (block !== null) blocks[kind] = block; // without a spring it still pushes
  }
  return { ...blocks, constant };
}

async function create(device: HidDevice, layouts: PidLayouts, kind: EffectKind): Promise<number | null> {
  await send(device, createNewEffect(layouts, kind));
  for (let tries = 0; tries < LOAD_TRIES; tries += 1) {
    const load = readBlockLoad(layouts, await receive(device, layouts.blockLoad.id));
    if (load.kind === "loaded") return load.block;
    if (load.kind === "full") return null;
  }
  return null;
}

async function receive(device: HidDevice, id: number): Promise<Uint8Array> {
  const view = await device.receiveFeatureReport(id);
  return new Uint8Array(view.buffer, view.byteOffset, view.byteLength);
}

async function send(device: HidDevice, { kind, id, data }: Report): Promise<void> {
  await (kind === "output" ? device.sendReport(id, data) : device.sendFeatureReport(id, data));
}
