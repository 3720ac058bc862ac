import { isNewer } from "../gate/serial";

/** The strongest force measured at one event. */
export interface TracePoint {
  readonly event: number;
  force: number; // N
}

/** Forces over events, the newest last. */
export interface ForceTrace {
  readonly points: TracePoint[];
}

export const TRACE_EVENTS = 120;

export function createForceTrace(): ForceTrace {
  return { points: [] };
}

/** An event that is measured again keeps the strongest: a knock must not be lost between two pictures of the chart. */
export function noteForce(trace: ForceTrace, event: number, force: number): void {
  const last = trace.points.at(-1);
  const known = Number.isFinite(force) ? force : 0;
  if (last?.event === event) {
    last.force = Math.max(last.force, known);
    return;
  }
  if (last !== undefined && !isNewer(event, last.event)) trace.points.length = 0; // another run of the robot
  trace.points.push({ event, force: known });
  if (trace.points.length > TRACE_EVENTS) trace.points.shift();
}

export function clearTrace(trace: ForceTrace): void {
  trace.points.length = 0;
}

/** The outline of the area under the trace in a box of `width` by `height`, the newest event at its right; "" when empty. */
export function tracePath(trace: ForceTrace, full: number, width: number, height: number): string {
  const { points } = trace;
  if (points.length === 0 || !(full > 0)) return "";
  const place = (at: number): number => width - ((points.length - 1 - at) * width) / (TRACE_EVENTS - 1);
  const level = (force: number): number => height * (1 - Math.min(1, Math.max(0, force / full)));
  const line = points.map(({ force }, at) => `L${place(at).toFixed(1)} ${level(force).toFixed(1)}`).join("");
  return `M${place(0).toFixed(1)} ${height}${line}L${width} ${height}Z`;
}
