import { distance, type Vector } from "../util/rigid";

/** Places of a tracked hand's joints by their WebXR names; null: not tracked. */
export type JointPlaces = (name: string) => Vector | null;

/** The gesture of a hand without a controller. */
export interface HandGesture {
  readonly squeeze: number; // 0 open, 1: middle, ring and little finger closed
  readonly pinch: number; // 0 apart, 1: the tips of thumb and index finger touch
}

const CLOSED_FINGERS = ["middle", "ring", "pinky"] as const;
/** From the wrist to the tip by that to the knuckle, which is the same for hands of all sizes. */
const OPEN_REACH = 1.7;
const CLOSED_REACH = 1.05;
const APART = 0.06; // m
const TOUCHING = 0.018; // m between the middles of the tips

/** null: a joint that it needs is not tracked. */
export function readGesture(joint: JointPlaces): HandGesture | null {
  const [wrist, thumb, index] = [joint("wrist"), joint("thumb-tip"), joint("index-finger-tip")];
  if (wrist === null || thumb === null || index === null) return null;
  let squeeze = 1;
  for (const finger of CLOSED_FINGERS) {
    const [tip, knuckle] = [joint(`${finger}-finger-tip`), joint(`${finger}-finger-phalanx-proximal`)];
    if (tip === null || knuckle === null) return null;
    const reach = distance(tip, wrist) / distance(knuckle, wrist);
    squeeze = Math.min(squeeze, share(reach, OPEN_REACH, CLOSED_REACH)); // the one that is least closed
  }
  return { squeeze, pinch: share(distance(thumb, index), APART, TOUCHING) };
}

function share(value: number, none: number, full: number): number {
  const found = (value - none) / (full - none);
  return Number.isFinite(found) ? Math.min(1, Math.max(0, found)) : 0;
}
