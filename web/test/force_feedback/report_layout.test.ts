import { describe, expect, it } from "vitest";
import type { HidCollection, HidItem } from "../../src/force_feedback/hid";
import { describePid } from "../../src/force_feedback/pid_device";
import { findReport } from "../../src/force_feedback/report_layout";
import {
  emptyReport,
  fieldOf,
  ofDegrees,
  ofPhysical,
  ofShare,
  readField,
  writeField,
} from "../../src/force_feedback/report_values";
import * as usages from "../../src/force_feedback/pid_usages";
import { forceStickCollections } from "./fake_stick";

type Writable<T> = { -readonly [Name in keyof T]: Writable<T[Name]> };

/** The fake's collections, with one thing changed in each item that `change` gets. */
function changed(change: (item: Writable<HidItem>) => void): HidCollection[] {
  const collections = forceStickCollections() as Writable<HidCollection>[];
  const walk = (collection: Writable<HidCollection>): void => {
    for (const report of [...collection.outputReports, ...collection.featureReports])
      report.items.forEach(change);
    collection.children.forEach(walk);
  };
  collections.forEach(walk);
  return collections;
}

function without(usage: number): HidCollection[] {
  const pruned = (collection: HidCollection): HidCollection => ({
    ...collection,
    children: collection.children
      .filter((child) => child.usagePage * 0x10000 + child.usage !== usage)
      .map(pruned),
  });
  return forceStickCollections().map(pruned);
}

describe("the layout of a report", () => {
  it("has the places that the descriptor gives, through collections in collections", () => {
    const layout = findReport(forceStickCollections(), "output", usages.REPORTS.setEffect);
    if (layout === null) throw new Error("no layout");
    const place = (usage: number, within?: number): number | undefined =>
      fieldOf(layout, usage, within ?? null)?.bit;
    expect([layout.id, layout.bytes]).toEqual([1, 13]);
    expect(place(usages.EFFECT_BLOCK_INDEX)).toBe(0);
    expect(place(usages.DURATION)).toBe(16);
    expect(place(usages.GAIN)).toBe(48);
    expect(place(usages.Y, usages.AXES_ENABLE)).toBe(65);
    expect(place(usages.DIRECTION_ENABLE)).toBe(66);
    expect(place(usages.FIRST_ORDINAL, usages.DIRECTION)).toBe(72);
    expect(place(usages.FIRST_ORDINAL, 0x0f0058)).toBe(88);
  });

  it("is of its own kind: an output and a feature report may have one id", () => {
    const collections = forceStickCollections();
    expect(findReport(collections, "feature", usages.REPORTS.createNewEffect)?.bytes).toBe(3);
    expect(findReport(collections, "output", usages.REPORTS.setConstantForce)?.bytes).toBe(3);
    expect(findReport(collections, "output", usages.REPORTS.createNewEffect)).toBeNull();
  });

  it("is none where a descriptor asks for a report of any length, or nests without end", () => {
    const long = changed((item) => (item.reportCount = 2 ** 31));
    expect(findReport(long, "output", usages.REPORTS.setEffect)).toBeNull();
    const odd = changed((item) => (item.reportSize = 0.5));
    expect(findReport(odd, "output", usages.REPORTS.setEffect)).toBeNull();
    let deep: HidCollection = { usagePage: 1, usage: 4, children: [], outputReports: [], featureReports: [] };
    for (let level = 0; level < 40; level += 1) deep = { ...deep, children: [deep] };
    expect(findReport([deep], "output", usages.REPORTS.setEffect)).toBeNull();
  });
});

describe("a value of a report", () => {
  const item = (parts: Partial<HidItem>): HidItem => ({
    ...{ isArray: false, isConstant: false, isRange: false, usages: [1], usageMinimum: 0, usageMaximum: 0 },
    ...{ reportSize: 8, reportCount: 1, unitExponent: 0, logicalMinimum: 0, logicalMaximum: 255 },
    ...{ physicalMinimum: 0, physicalMaximum: 0 },
    ...parts,
  });

  it("is read as it was written, at any place and of any size, and touches nothing else", () => {
    for (let size = 1; size <= 32; size += 1)
      for (const bit of [0, 1, 7, 8, 13]) {
        const isSigned = size % 2 === 0;
        const half = 2 ** (size - 1);
        const logicalMinimum = isSigned ? -half : 0;
        const field = { usages: [1], within: [], bit, item: item({ reportSize: size, logicalMinimum }) };
        for (const value of isSigned ? [-half, -1, 0, half - 1] : [0, 1, 2 ** size - 1]) {
          const report = emptyReport({ kind: "output", id: 1, bytes: 8, fields: [] });
          report.data.fill(0xff);
          writeField(report, field, value);
          expect(readField(report.data, field)).toBe(value);
          writeField(report, field, isSigned ? -1 : 2 ** size - 1);
          expect(report.data.every((byte) => byte === 0xff)).toBe(true);
        }
      }
  });

  it("is cut to what the field can hold, and not read past the end", () => {
    const field = (parts: Partial<HidItem>) => ({ usages: [1], within: [], bit: 0, item: item(parts) });
    const signed = field({ logicalMinimum: -127, logicalMaximum: 127 });
    expect([2, 1, 0.5, 0, -1, -2].map((share) => ofShare(signed, share))).toEqual([
      127, 127, 64, 0, -127, -127,
    ]);
    expect(ofShare(field({}), -1)).toBe(0);
    expect([0, 180, 359, 360, -90].map((degrees) => ofDegrees(field({}), degrees))).toEqual([
      0, 128, 254, 0, 191,
    ]);
    const time = field({ reportSize: 16, unitExponent: -3, logicalMaximum: 32767 });
    expect([0, 0.25, 32, 33].map((seconds) => ofPhysical(time, seconds))).toEqual([0, 250, 32000, null]);
    const hundredths = field({ unitExponent: -3, logicalMaximum: 100, physicalMaximum: 1000 });
    expect(ofPhysical(hundredths, 0.25)).toBe(25);
    expect(readField(new Uint8Array(0), field({}))).toBeNull();
  });
});

describe("a device that can push", () => {
  it("is known by its descriptor, with the effects that it can create", () => {
    const described = describePid(forceStickCollections());
    expect(described.kind === "pid" && described.layouts.kinds).toEqual(["constant", "spring", "damper"]);
    const bare = describePid(without(usages.REPORTS.setCondition));
    expect(bare.kind === "pid" && bare.layouts.kinds).toEqual(["constant"]);
  });

  it("is refused, with the reason, when it lacks what is needed", () => {
    const { setEffect, deviceControl, blockLoad } = usages.REPORTS;
    const why = (collections: HidCollection[]): string => {
      const described = describePid(collections);
      return described.kind === "unusable" ? described.why : "usable";
    };
    expect(why([])).toContain("no report to describe an effect");
    expect(why(without(setEffect))).toContain("no report to describe an effect");
    expect(why(without(deviceControl))).toContain("no report to stop everything");
    expect(why(without(blockLoad))).toContain("manage its memory");
  });

  it("is refused when its durations have no unit: an effect could last for ever", () => {
    const described = describePid(changed((item) => (item.unitExponent = 0)));
    expect(described).toEqual({ kind: "unusable", why: expect.stringContaining("how long") as string });
  });
});
