import type { HidCollection, HidItem, HidReport } from "./hid";

export type ReportKind = "output" | "feature";

/** One field of a report: bits and their meaning. */
export interface Field {
  readonly usages: readonly number[]; // the one of a variable; those that an array chooses from
  readonly within: readonly number[]; // usages of the collections around it, the innermost last
  readonly bit: number; // offset in the report, without its id
  readonly item: HidItem;
}

export interface ReportLayout {
  readonly kind: ReportKind;
  readonly id: number;
  readonly bytes: number; // without the id
  readonly fields: readonly Field[];
}

/** No device of the kind has longer ones: a descriptor comes from whatever is plugged in. */
const MAX_REPORT_BITS = 8 * 256;
const MAX_DEPTH = 16;

/**
 * The layout of the one report that belongs to the collection of this usage (page and usage, 32 bits); null when there is none.
 *
 * WebHID lists a report's items in each collection from the innermost to the top; only the topmost has all of them, in
 * the order of their bits. The others tell which items belong to which collection.
 */
export function findReport(
  collections: readonly HidCollection[],
  kind: ReportKind,
  usage: number,
): ReportLayout | null {
  for (const top of collections) {
    const holder = findCollection(top, usage, 0);
    const id = holder === null ? undefined : reportsOf(holder, kind)[0]?.reportId;
    const whole = id === undefined ? undefined : reportsOf(top, kind).find((each) => each.reportId === id);
    if (whole !== undefined) return layoutOf(top, kind, whole);
  }
  return null;
}

function layoutOf(top: HidCollection, kind: ReportKind, report: HidReport): ReportLayout | null {
  const fields: Field[] = [];
  let bit = 0;
  for (const { item, within } of placed(top, kind, report, [], 0)) {
    const { reportSize: size, reportCount: count } = item;
    const isPossible = Number.isInteger(size) && Number.isInteger(count) && size >= 0 && count >= 0;
    if (!isPossible || bit + size * count > MAX_REPORT_BITS) return null;
    const isRead = !item.isConstant && size >= 1 && size <= 32;
    for (let at = 0; isRead && at < count; at += 1)
      fields.push({ usages: usagesOf(item, at), within, bit: bit + at * size, item });
    bit += size * count;
  }
  return { kind, id: report.reportId, bytes: Math.ceil(bit / 8), fields };
}

interface Placed {
  readonly item: HidItem;
  readonly within: readonly number[];
}

/** Each item of a report with the collections around it. A collection's items stand together, in the order of the collections. */
function placed(
  collection: HidCollection,
  kind: ReportKind,
  report: HidReport,
  around: readonly number[],
  depth: number,
): Placed[] {
  const within = [...around, usageOf(collection)];
  const { items } = report;
  const found: Placed[] = [];
  let at = 0;
  const take = (end: number): void => {
    for (const item of items.slice(at, end)) found.push({ item, within });
    at = end;
  };
  for (const child of depth < MAX_DEPTH ? collection.children : []) {
    const part = reportsOf(child, kind).find((each) => each.reportId === report.reportId);
    if (part === undefined || part.items.length === 0) continue;
    const start = indexOfRun(items, part.items, at);
    if (start < 0) continue;
    take(start);
    found.push(...placed(child, kind, part, within, depth + 1));
    at = start + part.items.length;
  }
  take(items.length);
  return found;
}

function indexOfRun(items: readonly HidItem[], run: readonly HidItem[], from: number): number {
  for (let start = from; start + run.length <= items.length; start += 1)
    if (run.every((item, at) => isSame(item, items[start + at]))) return start;
  return -1;
}

function isSame(one: HidItem, other: HidItem | undefined): boolean {
  return (
    other !== undefined &&
    one.isConstant === other.isConstant &&
    one.isArray === other.isArray &&
    one.reportSize === other.reportSize &&
    one.reportCount === other.reportCount &&
    one.logicalMinimum === other.logicalMinimum &&
    one.logicalMaximum === other.logicalMaximum &&
    one.usageMinimum === other.usageMinimum &&
    one.usages.length === other.usages.length &&
    one.usages.every((usage, at) => usage === other.usages[at])
  );
}

const MAX_USAGES = 256;

function usagesOf(item: HidItem, at: number): readonly number[] {
  const { usageMinimum: first, usageMaximum: last, usages } = item;
  const count = item.isRange ? Math.min(MAX_USAGES, last - first + 1) : 0;
  const listed = item.isRange
    ? Array.from({ length: Math.max(0, count) }, (_, step) => first + step)
    : usages;
  // HID 1.11, 6.2.2.8: the last usage is that of all fields that follow.
  return item.isArray ? listed : listed.slice(Math.min(at, listed.length - 1)).slice(0, 1);
}

function findCollection(collection: HidCollection, usage: number, depth: number): HidCollection | null {
  if (usageOf(collection) === usage) return collection;
  if (depth >= MAX_DEPTH) return null;
  for (const child of collection.children) {
    const found = findCollection(child, usage, depth + 1);
    if (found !== null) return found;
  }
  return null;
}

function usageOf({ usagePage, usage }: HidCollection): number {
  return usagePage * 0x1_0000 + usage;
}

function reportsOf(collection: HidCollection, kind: ReportKind): readonly HidReport[] {
  return kind === "output" ? collection.outputReports : collection.featureReports;
}
