import type { HidCollection } from "./hid";
import { findReport, type ReportKind, type ReportLayout } from "./report_layout";
import { fieldOf, ofPhysical } from "./report_values";
import {
  DURATION,
  EFFECT_BLOCK_INDEX,
  EFFECT_TYPES,
  MAGNITUDE,
  REPORTS,
  type EffectKind,
} from "./pid_usages";

/** The reports of a device that can push; those that it may lack are null. */
export interface PidLayouts {
  readonly createNewEffect: ReportLayout;
  readonly blockLoad: ReportLayout;
  readonly setEffect: ReportLayout;
  readonly setConstantForce: ReportLayout;
  readonly effectOperation: ReportLayout;
  readonly deviceControl: ReportLayout;
  readonly setCondition: ReportLayout | null; // needed for springs and dampers
  readonly pool: ReportLayout | null;
  readonly deviceGain: ReportLayout | null;
  readonly kinds: readonly EffectKind[]; // that it can create
}

export type PidDescription =
  | { readonly kind: "pid"; readonly layouts: PidLayouts }
  | { readonly kind: "unusable"; readonly why: string };

const SHORTEST_SECONDS = 0.02;
const NEEDED = ["setEffect", "setConstantForce", "effectOperation", "deviceControl"] as const;

/** The parts of PID 1.0 that a device's descriptor offers, or the reason why it cannot be used. */
export function describePid(collections: readonly HidCollection[]): PidDescription {
  const find = (name: keyof typeof REPORTS, kind: ReportKind): ReportLayout | null =>
    findReport(collections, kind, REPORTS[name]);
  const outputs = NEEDED.map((name) => find(name, "output"));
  const missing = NEEDED.find((_name, at) => outputs[at] === null);
  if (missing !== undefined) return unusable(`it has no report to ${WORDS[missing]}`);
  const [setEffect, setConstantForce, effectOperation, deviceControl] = outputs;
  const createNewEffect = find("createNewEffect", "feature");
  const blockLoad = find("blockLoad", "feature");
  if (createNewEffect === null || blockLoad === null)
    return unusable("its host would have to manage its memory, which this page does not do");
  if (!setEffect || !setConstantForce || !effectOperation || !deviceControl)
    return unusable("it lacks reports");
  const duration = fieldOf(setEffect, DURATION);
  // An effect that could not be told to end would go on after the page has died.
  if (
    duration === null ||
    duration.item.unitExponent >= 0 ||
    !((ofPhysical(duration, SHORTEST_SECONDS) ?? 0) > 0)
  )
    return unusable("it does not say how long an effect lasts in a unit of time");
  if (fieldOf(setConstantForce, MAGNITUDE) === null || fieldOf(blockLoad, EFFECT_BLOCK_INDEX) === null)
    return unusable("its reports lack fields");
  const setCondition = find("setCondition", "output");
  const isKnown = (kind: EffectKind): boolean =>
    fieldOf(createNewEffect, EFFECT_TYPES[kind]) !== null && fieldOf(setEffect, EFFECT_TYPES[kind]) !== null;
  const kinds = (["constant", "spring", "damper"] as const).filter(
    (kind) => isKnown(kind) && (kind === "constant" || setCondition !== null),
  );
  if (!kinds.includes("constant")) return unusable("it has no constant force");
  return {
    kind: "pid",
    layouts: {
      ...{ createNewEffect, blockLoad, setEffect, setConstantForce, effectOperation, deviceControl },
      ...{ setCondition, kinds },
      pool: find("pool", "feature"),
      deviceGain: find("deviceGain", "output"),
    },
  };
}

const WORDS: Readonly<Record<(typeof NEEDED)[number], string>> = {
  setEffect: "describe an effect",
  setConstantForce: "set a constant force",
  effectOperation: "start and stop effects",
  deviceControl: "stop everything",
};

function unusable(why: string): PidDescription {
  return { kind: "unusable", why };
}
