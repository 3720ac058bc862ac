import type { Feedback } from "../protocol/wire";
import { eventGap } from "./serial";

/** What the page's own drawing needs of a feedback. */
export type ScenePose = Pick<
  Feedback,
  "event" | "goals" | "joints" | "wrench" | "ranges" | "limits" | "unknown"
>;

/** The newest feedbacks, oldest first, one for each event: pictures show an event some feedbacks ago. */
export interface ScenePoses {
  readonly kept: ScenePose[];
}

/** Pictures further behind than this are beyond any tolerance. */
const MAX_KEPT = 200;

export function createScenePoses(): ScenePoses {
  return { kept: [] };
}

/** Takes a feedback that is no older than the one before; a later one of the same event takes its place. */
export function keepPose(poses: ScenePoses, pose: ScenePose): void {
  const { kept } = poses;
  if (kept.at(-1)?.event === pose.event) kept.pop();
  kept.push(pose);
  if (kept.length > MAX_KEPT) kept.shift();
}

/** The robot as it was at event `due`, or at the newest event before it that is known; null: nothing is. */
export function poseDue(poses: ScenePoses, due: number | "all" | null): ScenePose | null {
  if (due === null) return null;
  if (due === "all") return poses.kept.at(-1) ?? null;
  return poses.kept.findLast((pose) => eventGap(due, pose.event) >= 0) ?? null;
}

/** Another robot or bridge: its events begin anew. */
export function forgetPoses(poses: ScenePoses): void {
  poses.kept.length = 0;
}
