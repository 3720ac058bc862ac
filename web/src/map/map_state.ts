import type { Action, ActionUpdate, Feedback, Navigation, RobotDescription } from "../protocol/wire";
import { compose, type PlanarPose, type Point } from "./map_geometry";

/** The robot's place on its map. */
export type Place =
  | { readonly kind: "known"; readonly pose: PlanarPose; readonly event: number }
  | { readonly kind: "unknown"; readonly why: string };

/** The age after which nothing heard of the navigation means that it is not known: it is sent every second. */
export const SILENT_MS = 3000;

/** Where the robot is on its map, by the pose of the newest feedback. `isOld`: no feedback comes any more. */
export function placeOf(
  description: RobotDescription,
  feedback: Feedback | null,
  navigation: Navigation | null,
  isOld: boolean,
): Place {
  const { map } = description;
  if (map === null || feedback === null || isOld)
    return { kind: "unknown", why: "No feedback from the robot" };
  if (navigation === null) return { kind: "unknown", why: "The robot has not said where it is" };
  if (!navigation.located) return { kind: "unknown", why: "The robot does not know where it is on the map" };
  const pose = [map.x, map.y, map.yaw].map((name) => {
    const index = description.joints.findIndex((joint) => joint.name === name);
    return feedback.unknown.includes(name) ? undefined : feedback.joints[index];
  });
  const [x, y, yaw] = pose;
  if (x === undefined || y === undefined || yaw === undefined)
    return { kind: "unknown", why: "The robot's pose is not measured now" };
  return { kind: "known", pose: compose(navigation.frame, [x, y, yaw]), event: feedback.event };
}

/** The scan of the robot's own body; null: there is none, or its sensor is somewhere else. */
export function scanOf(
  description: RobotDescription,
  feedback: Feedback | null,
): { ring: NonNullable<RobotDescription["ranges"]>; ranges: readonly number[] } | null {
  const { map, ranges: ring, bodies } = description;
  const ranges = feedback?.ranges ?? [];
  const body = bodies.find((each) => each.name === ring?.body);
  if (map === null || ring === null || ranges.length === 0 || body?.parent !== "") return null;
  const joints = body.joints.map((each) => each.joint);
  return joints.join() === [map.x, map.y, map.yaw].join() ? { ring, ranges } : null;
}

/** The points of a path, from pairs of numbers. */
export function pathPoints(path: readonly number[]): Point[] {
  const points: Point[] = [];
  for (let index = 0; index + 1 < path.length; index += 2)
    points.push([path[index] ?? 0, path[index + 1] ?? 0]);
  return points;
}

/** The action that goes to a place on the map; null: the robot has none. */
export function goalAction(description: RobotDescription): Action | null {
  return description.actions.find((each) => each.name === description.map?.goal) ?? null;
}

/** The parameters of a goal. Without a heading that was drawn, the robot arrives as it comes from here. */
export function goalParameters(
  action: Action,
  at: Point,
  towards: Point | null,
  robot: PlanarPose | null,
): Record<string, number> {
  const parameters: Record<string, number> = { x: at[0], y: at[1] };
  if (!action.parameters.some((each) => each.name === "yaw")) return parameters;
  const yaw = headingOf(at, towards, robot);
  if (yaw !== null) parameters["yaw"] = yaw;
  return parameters;
}

/** rad; null: nobody said it and it cannot be known. */
export function headingOf(at: Point, towards: Point | null, robot: PlanarPose | null): number | null {
  if (towards !== null) return Math.atan2(towards[1] - at[1], towards[0] - at[0]);
  return robot === null ? null : Math.atan2(at[1] - robot[1], at[0] - robot[0]);
}

/** Why a place is no goal by the action's own bounds; null: it may be one. */
export function beyondBounds(action: Action, parameters: Readonly<Record<string, number>>): string | null {
  for (const { name, label, minimum, maximum } of action.parameters) {
    const value = parameters[name];
    if (value === undefined) continue;
    if ((minimum !== null && value < minimum) || (maximum !== null && value > maximum))
      return `${label} is outside of what ${action.label} takes`;
  }
  return null;
}

/** The goal that runs, in words of its own robot; null: none does. */
export function runningGoal(actions: readonly ActionUpdate[], action: Action | null): ActionUpdate | null {
  return actions.find((each) => each.name === action?.name && each.state === "running") ?? null;
}

/** "12 s old", or "new". */
export function ageWords(seconds: number): string {
  if (seconds < 1.5) return "new";
  if (seconds < 120) return `${Math.round(seconds)} s old`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min old` : `${Math.round(seconds / 3600)} h old`;
}
