import type { Field, ReportLayout } from "./report_layout";

/** A report as WebHID sends it: the id apart from the bytes. */
export interface Report {
  readonly kind: ReportLayout["kind"];
  readonly id: number;
  readonly data: Uint8Array<ArrayBuffer>;
}

/** The field of this usage; null when the report has none. `within`: the collection around it must have this usage. */
export function fieldOf(layout: ReportLayout, usage: number, within: number | null = null): Field | null {
  const isIt = (field: Field): boolean =>
    field.usages.includes(usage) && (within === null || field.within.includes(within));
  return layout.fields.find(isIt) ?? null;
}

/** All fields are 0 at first. */
export function emptyReport(layout: ReportLayout): Report {
  return { kind: layout.kind, id: layout.id, data: new Uint8Array(layout.bytes) };
}

/** Writes a logical value, cut to the bits of the field: the low ones first (HID 1.11, 8.4). */
export function writeField({ data }: Report, { bit, item }: Field, value: number): void {
  const bits = value < 0 ? value + 2 ** item.reportSize : value;
  for (let at = 0; at < item.reportSize; at += 1) {
    const index = (bit + at) >> 3;
    const mask = 1 << ((bit + at) & 7);
    const isSet = Math.floor(bits / 2 ** at) % 2 === 1;
    data[index] = isSet ? (data[index] ?? 0) | mask : (data[index] ?? 0) & ~mask;
  }
}

/** Reads a logical value; null where the report ends before it. Signed where the logical minimum is. */
export function readField(data: Uint8Array, { bit, item }: Field): number | null {
  if (bit + item.reportSize > 8 * data.length) return null;
  let value = 0;
  for (let at = 0; at < item.reportSize; at += 1)
    if (((data[(bit + at) >> 3] ?? 0) >> ((bit + at) & 7)) & 1) value += 2 ** at;
  const isNegative = item.logicalMinimum < 0 && value >= 2 ** (item.reportSize - 1);
  return isNegative ? value - 2 ** item.reportSize : value;
}

/** The value with which an array field names this usage (HID 1.11, 6.2.2.5). */
export function indexOf({ usages, item }: Field, usage: number): number {
  return item.logicalMinimum + usages.indexOf(usage);
}

/** The usage that an array field names; null when the field has no such usage. */
export function usageNamed({ usages, item }: Field, value: number): number | null {
  return usages[value - item.logicalMinimum] ?? null;
}

/** A share from -1 to 1 of what the field reaches. A field without negative values takes 0 for what is below. */
export function ofShare({ item }: Field, share: number): number {
  const { logicalMinimum: least, logicalMaximum: most } = item;
  const bounded = Math.max(-1, Math.min(1, share));
  const value = Math.round(bounded < 0 ? bounded * -least : bounded * most);
  return Math.max(least, Math.min(most, value === 0 ? 0 : value));
}

/** An angle from 0 (included) to 360 degrees (excluded), over the whole range of the field. */
export function ofDegrees({ item }: Field, degrees: number): number {
  const { logicalMinimum: least, logicalMaximum: most } = item;
  return Math.round(least + ((((degrees % 360) + 360) % 360) / 360) * (most - least));
}

/**
 * A physical value in the field's base unit, rounded down; null where the field cannot hold it. Without a range of physical
 * values these are the logical ones (HID 1.11, 6.2.2.7).
 */
export function ofPhysical({ item }: Field, value: number): number | null {
  const { logicalMinimum: least, logicalMaximum: most, physicalMinimum: low, physicalMaximum: high } = item;
  const hasRange = high > low;
  const scaled = value / 10 ** item.unitExponent;
  const logical = hasRange ? least + ((scaled - low) * (most - least)) / (high - low) : scaled;
  const whole = Math.floor(logical + 1e-6);
  return whole >= least && whole <= most ? whole : null;
}
