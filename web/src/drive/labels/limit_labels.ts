import type { Feedback, RobotDescription, SpeedCapState } from "../../protocol/wire";

/** One thing that keeps the robot from doing all that is asked of it. */
export interface LimitLabel {
  readonly tone: "cap" | "limit" | "fault";
  readonly text: string;
}

export const WAITS_LABEL = "Waits until the robot stands still";

/** What holds the robot back now, the gravest first. */
export function limitLabels(
  feedback: Feedback | null,
  description: RobotDescription | null,
  cap: SpeedCapState | null,
  share: number,
  refused: readonly string[] = [], // goals, in words
  waits = false, // somebody wants to drive a goal axis that does not stand still yet
): LimitLabel[] {
  const words: LimitLabel[] = refused.map((text) => ({ tone: "fault", text }));
  if (waits) words.push({ tone: "limit", text: WAITS_LABEL });
  for (const fault of feedback?.faults ?? []) words.push({ tone: "fault", text: fault });
  for (const name of feedback?.limits ?? [])
    words.push({ tone: "limit", text: limitLabel(name, description) });
  if (share < 0.995) words.push({ tone: "cap", text: capText(cap, share) });
  return words;
}

function limitLabel(name: string, description: RobotDescription | null): string {
  const fence = description?.geofences.find((each) => each.name === name);
  if (fence !== undefined) return `${fence.kind === "keep_out" ? "Keep out" : "Stay inside"}: ${fence.label}`;
  const limit = description?.position_limits.find((each) => each.name === name);
  return `End of range: ${limit?.label ?? name}`;
}

function capText(cap: SpeedCapState | null, share: number): string {
  const delay = cap?.delay_ms ?? null;
  const why = delay === null ? "delay unknown" : `${delay.toFixed(0)} ms delay`;
  return `Speed ${Math.round(share * 100)} % · ${why}`;
}
