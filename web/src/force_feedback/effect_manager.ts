import { setCondition, setConstantForce, setEffect, effectOperation } from "./pid_reports";
import type { PidLayouts } from "./pid_device";
import type { EffectKind } from "./pid_usages";
import type { ForceSettings } from "./force_settings";
import type { Report } from "./report_values";
import { lengthOf, NO_FORCE, ramped, sourceDegrees, type StickForce } from "./stick_force";

/** Effect block indices that the device gave; no entry where it has no such effect. */
export type EffectBlocks = Readonly<Partial<Record<EffectKind, number>>> & { readonly constant: number };

/** The force that the hand may feel now. */
export interface Wanted {
  readonly force: StickForce; // share of the strongest that the settings allow
  readonly holdSeconds: number; // of the robot: no effect lasts longer
}

const LONGEST_SECONDS = 0.25;
const RENEWED_AFTER = 0.4; // of an effect's duration
const GROWTH_SECONDS = 0.2; // from nothing to the strongest
const FALL_SECONDS = 0.05;
const FIRST_STEP_SECONDS = 0.02;
const LONGEST_STEP_SECONDS = 0.1;
const FELT = 0.004; // of the device's strongest: below it there is no force
const MAGNITUDE_STEP = 0.004;
const DEGREES_STEP = 2;
const CONDITIONS = ["spring", "damper"] as const;

interface Playing {
  startedMs: number;
}

/**
 * Decides which reports a device is sent: the constant force on its way to the one that is wanted, a spring and a
 * damper. Every effect ends by itself and is renewed, so that nothing pushes for a page that has gone.
 *
 * Call `step` at least every 100 ms with what is wanted, null for nothing, and send what it returns, in order. After a
 * report that could not be sent call `stop`, or use a new manager.
 */
export class EffectManager {
  private force = NO_FORCE;
  private steppedMs: number | null = null;
  private readonly playing = new Map<EffectKind, Playing>();
  private seconds = 0; // an effect's duration
  private readonly told = new Map<EffectKind, string>(); // parameters that the device has
  private toldDegrees: number | null = null;
  private toldMagnitude: number | null = null;

  constructor(
    private readonly layouts: PidLayouts,
    private readonly blocks: EffectBlocks,
    public settings: ForceSettings,
  ) {}

  /** Whether the device may be pushing. */
  get isPlaying(): boolean {
    return this.playing.size > 0;
  }

  step(wanted: Wanted | null, now: number): Report[] {
    if (wanted === null || !(wanted.holdSeconds > 0)) return this.stop();
    this.adopt(Math.min(LONGEST_SECONDS, wanted.holdSeconds));
    const passed = this.steppedMs === null ? FIRST_STEP_SECONDS : (now - this.steppedMs) / 1000;
    const elapsed = Math.max(0, Math.min(LONGEST_STEP_SECONDS, passed));
    this.steppedMs = now;
    const { strongest } = this.settings;
    const size = Math.max(1, lengthOf(wanted.force)); // a longer one is cut
    const to = {
      right: (wanted.force.right / size) * strongest,
      ahead: (wanted.force.ahead / size) * strongest,
    };
    const share = strongest * elapsed;
    this.force = ramped(this.force, to, share / GROWTH_SECONDS, share / FALL_SECONDS);
    return [...this.push(now), ...CONDITIONS.flatMap((kind) => this.condition(kind, now))];
  }

  /** Ends everything at once, without a ramp. */
  stop(): Report[] {
    const reports = [...this.playing.keys()].flatMap((kind) => this.end(kind));
    this.force = NO_FORCE;
    this.steppedMs = null;
    // Of what was decided last some may not have been sent: the device is told all of it again.
    this.told.clear();
    this.toldDegrees = null;
    this.toldMagnitude = null;
    return reports;
  }

  private adopt(seconds: number): void {
    if (seconds === this.seconds) return;
    this.seconds = seconds;
    this.told.clear();
    this.toldDegrees = null;
  }

  private push(now: number): Report[] {
    const { layouts } = this;
    const { constant: block } = this.blocks;
    const magnitude = Math.min(this.settings.strongest, lengthOf(this.force));
    if (!(magnitude >= FELT)) return this.end("constant");
    const source = sourceDegrees(this.force);
    const degrees = this.settings.reversed ? (source + 180) % 360 : source;
    const reports: Report[] = [];
    if (this.toldDegrees === null || between(degrees, this.toldDegrees) >= DEGREES_STEP) {
      this.toldDegrees = degrees;
      reports.push(setEffect(layouts, { kind: "constant", block, seconds: this.seconds, degrees }));
    }
    const isDue = this.isDue("constant", now);
    if (this.toldMagnitude === null || isDue || Math.abs(magnitude - this.toldMagnitude) >= MAGNITUDE_STEP) {
      this.toldMagnitude = magnitude;
      reports.push(setConstantForce(layouts, block, magnitude));
    }
    if (isDue) reports.push(this.begin("constant", block, now));
    return reports;
  }

  private condition(kind: (typeof CONDITIONS)[number], now: number): Report[] {
    const block = this.blocks[kind];
    const share = this.settings[kind];
    if (block === undefined || !(share > 0)) return this.end(kind);
    const reports: Report[] = [];
    const parameters = String(share);
    if (this.told.get(kind) !== parameters) {
      this.told.set(kind, parameters);
      const { layouts, seconds } = this;
      reports.push(setEffect(layouts, { kind, block, seconds, degrees: 0 }));
      for (const axis of [0, 1] as const) {
        const report = setCondition(layouts, block, axis, share);
        if (report !== null) reports.push(report);
      }
    }
    if (this.isDue(kind, now)) reports.push(this.begin(kind, block, now));
    return reports;
  }

  private isDue(kind: EffectKind, now: number): boolean {
    const playing = this.playing.get(kind);
    return playing === undefined || now - playing.startedMs >= 1000 * RENEWED_AFTER * this.seconds;
  }

  private begin(kind: EffectKind, block: number, now: number): Report {
    this.playing.set(kind, { startedMs: now });
    return effectOperation(this.layouts, block, "start");
  }

  private end(kind: EffectKind): Report[] {
    const block = this.blocks[kind];
    if (!this.playing.delete(kind) || block === undefined) return [];
    return [effectOperation(this.layouts, block, "stop")];
  }
}

function between(one: number, other: number): number {
  const apart = Math.abs(one - other) % 360;
  return Math.min(apart, 360 - apart);
}
