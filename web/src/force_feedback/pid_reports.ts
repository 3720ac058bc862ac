import type { PidLayouts } from "./pid_device";
import type { Field, ReportLayout } from "./report_layout";
import {
  emptyReport,
  fieldOf,
  indexOf,
  ofDegrees,
  ofPhysical,
  ofShare,
  readField,
  usageNamed,
  writeField,
  type Report,
} from "./report_values";
import * as usages from "./pid_usages";

/** The parameters of an effect. */
export interface EffectParameters {
  readonly kind: usages.EffectKind;
  readonly block: number; // its effect block index
  readonly seconds: number; // it plays, then it ends by itself
  readonly degrees: number; // of a constant force: where it comes from, 0 from ahead, 90 from the right
}

/** PID 1.0, "Create New Effect": a feature report, answered by a block load. */
export function createNewEffect(layouts: PidLayouts, kind: usages.EffectKind): Report {
  return compose(layouts.createNewEffect, (write) => {
    write.named(usages.EFFECT_TYPES[kind]);
  });
}

/** PID 1.0, "Set Effect". A constant force has a direction; a condition has parameters for each axis instead. */
export function setEffect(layouts: PidLayouts, effect: EffectParameters): Report {
  const { setEffect: layout } = layouts;
  const isConstant = effect.kind === "constant";
  return compose(layout, (write) => {
    write.value(usages.EFFECT_BLOCK_INDEX, effect.block);
    write.named(usages.EFFECT_TYPES[effect.kind]);
    const duration = fieldOf(layout, usages.DURATION);
    if (duration !== null) write.field(duration, Math.max(1, ofPhysical(duration, effect.seconds) ?? 1));
    write.share(usages.GAIN, 1);
    const trigger = fieldOf(layout, usages.TRIGGER_BUTTON);
    if (trigger !== null) write.field(trigger, noButton(trigger));
    for (const axis of [usages.X, usages.Y]) write.value(axis, isConstant ? 0 : 1, usages.AXES_ENABLE);
    write.value(usages.DIRECTION_ENABLE, isConstant ? 1 : 0);
    const direction = directionOf(layout);
    if (isConstant && direction !== null) write.field(direction, ofDegrees(direction, effect.degrees));
  });
}

/** PID 1.0, "Set Constant Force". `share`: 0 to 1 of the device's strongest force. */
export function setConstantForce(layouts: PidLayouts, block: number, share: number): Report {
  return compose(layouts.setConstantForce, (write) => {
    write.value(usages.EFFECT_BLOCK_INDEX, block);
    write.share(usages.MAGNITUDE, share);
  });
}

/** PID 1.0, "Set Condition": around the middle, alike to both sides. `axis`: 0 for X, 1 for Y. `share`: 0 to 1. */
export function setCondition(layouts: PidLayouts, block: number, axis: 0 | 1, share: number): Report | null {
  if (layouts.setCondition === null) return null;
  return compose(layouts.setCondition, (write) => {
    write.value(usages.EFFECT_BLOCK_INDEX, block);
    write.value(usages.PARAMETER_BLOCK_OFFSET, axis);
    write.share(usages.POSITIVE_COEFFICIENT, share);
    write.share(usages.NEGATIVE_COEFFICIENT, share);
    write.share(usages.POSITIVE_SATURATION, share);
    write.share(usages.NEGATIVE_SATURATION, share);
  });
}

/** PID 1.0, "Effect Operation". */
export function effectOperation(
  layouts: PidLayouts,
  block: number,
  operation: usages.EffectOperation,
): Report {
  return compose(layouts.effectOperation, (write) => {
    write.value(usages.EFFECT_BLOCK_INDEX, block);
    write.named(usages.OPERATIONS[operation]);
    write.value(usages.LOOP_COUNT, operation === "start" ? 1 : 0);
  });
}

/** PID 1.0, "Device Control". Devices give each control a bit, or name one of a list. */
export function deviceControl(layouts: PidLayouts, control: usages.DeviceControl): Report {
  return compose(layouts.deviceControl, (write) => {
    write.named(usages.CONTROLS[control]);
  });
}

/** PID 1.0, "Device Gain"; null where the device has none. */
export function deviceGain({ deviceGain: layout }: PidLayouts): Report | null {
  return layout === null ? null : compose(layout, (write) => write.share(usages.DEVICE_GAIN, 1));
}

export type BlockLoad =
  { readonly kind: "loaded"; readonly block: number } | { readonly kind: "full" } | { readonly kind: "bad" };

/** PID 1.0, "Block Load": what became of the effect that was asked for last. */
export function readBlockLoad({ blockLoad: layout }: PidLayouts, data: Uint8Array): BlockLoad {
  const bytes = withoutId(layout, data);
  const status = fieldOf(layout, usages.LOAD_SUCCESS);
  const index = fieldOf(layout, usages.EFFECT_BLOCK_INDEX);
  const named = status === null ? null : namedBy(status, readField(bytes, status));
  const block = index === null ? null : readField(bytes, index);
  if (named === usages.LOAD_FULL) return { kind: "full" };
  return named === usages.LOAD_SUCCESS && block !== null && block > 0
    ? { kind: "loaded", block }
    : { kind: "bad" };
}

/** Of an array the usage that it names; a bit names its own when it is set. */
function namedBy(field: Field, value: number | null): number | null {
  if (value === null) return null;
  if (field.item.isArray) return usageNamed(field, value);
  return value === 1 ? (field.usages[0] ?? null) : null;
}

/** PID 1.0, "PID Pool": whether the device itself looks after the memory of its effects. Without the report it does. */
export function managesItsPool({ pool: layout }: PidLayouts, data: Uint8Array | null): boolean {
  const field = layout === null ? null : fieldOf(layout, usages.DEVICE_MANAGED_POOL);
  if (layout === null || field === null) return true;
  return data !== null && readField(withoutId(layout, data), field) === 1;
}

/** Browsers put the report's id in front of a feature report's bytes, where the device has ids. */
function withoutId(layout: ReportLayout, data: Uint8Array): Uint8Array {
  return layout.id !== 0 && data.length > layout.bytes && data[0] === layout.id ? data.subarray(1) : data;
}

/** PID 1.0: a value outside of the field's range is no button, and the effect plays without a button. */
function noButton({ item }: Field): number {
  return item.logicalMinimum > 0 ? 0 : 2 ** item.reportSize - 1;
}

/** The first direction; some devices name their axes there, others count. */
function directionOf(layout: ReportLayout): Field | null {
  return layout.fields.find((field) => field.within.includes(usages.DIRECTION)) ?? null;
}

interface Writer {
  field(field: Field, value: number): void;
  /** Fields that the device lacks stay away. */
  value(usage: number, value: number, within?: number): void;
  share(usage: number, share: number): void;
  /** Of an array the usage's index; of a bit, 1. */
  named(usage: number): void;
}

function compose(layout: ReportLayout, write: (writer: Writer) => void): Report {
  const report = emptyReport(layout);
  const put = (field: Field | null, value: (field: Field) => number): void => {
    if (field !== null) writeField(report, field, value(field));
  };
  write({
    field: (field, value) => put(field, () => value),
    value: (usage, value, within) => put(fieldOf(layout, usage, within ?? null), () => value),
    share: (usage, share) => put(fieldOf(layout, usage), (field) => ofShare(field, share)),
    named: (usage) =>
      put(fieldOf(layout, usage), (field) => (field.item.isArray ? indexOf(field, usage) : 1)),
  });
  return report;
}
