import type { Point } from "./map_geometry";

/** What a hand on the map asks for. Places in pixels of the view. */
export type Gesture =
  | { readonly kind: "pan"; readonly dx: number; readonly dy: number }
  | { readonly kind: "zoom"; readonly at: Point; readonly factor: number }
  | { readonly kind: "aim"; readonly at: Point; readonly towards: Point | null } // a goal that is not let go yet
  | { readonly kind: "goal"; readonly at: Point; readonly towards: Point | null }
  | { readonly kind: "none" }; // there is no goal any more

export type PointerKind = "mouse" | "touch";

/** How long a finger rests before it sets a goal. */
export const LONG_PRESS_MS = 500;
const STILL = 10; // pixels that a finger may wander meanwhile
const HEADING = 24; // pixels from the goal, from which on a drag says a heading

type Mode = "waits" | "pans" | "aims" | "pinches" | "over";

/**
 * A click of a mouse sets a goal, and a drag its heading; another button moves the map. A finger moves the map, two
 * zoom it, and one that rests sets a goal. Of any doubt comes no goal. Listeners call it; it knows no element.
 */
export class MapGestures {
  private readonly pointers = new Map<number, Point>();
  private mode: Mode = "over";
  private start: Point = [0, 0];
  private startMs = 0;

  /** `sets`: whether this press may set a goal (the main button of a mouse, or a finger, of a person who may drive). */
  down(id: number, kind: PointerKind, sets: boolean, at: Point, now: number): Gesture[] {
    this.pointers.set(id, at);
    if (this.pointers.size > 1) {
      const aimed = this.mode === "aims";
      this.mode = this.pointers.size === 2 ? "pinches" : "over";
      return aimed ? [{ kind: "none" }] : [];
    }
    this.start = at;
    this.startMs = now;
    if (kind === "touch") {
      this.mode = sets ? "waits" : "pans";
      return [];
    }
    this.mode = sets ? "aims" : "pans";
    return sets ? [this.aim("aim", at)] : [];
  }

  move(id: number, at: Point): Gesture[] {
    const before = this.pointers.get(id);
    if (before === undefined) return [];
    const others = [...this.pointers].filter(([each]) => each !== id).map(([, place]) => place);
    this.pointers.set(id, at);
    const other = others[0];
    if (this.mode === "pinches" && other !== undefined) return pinch(before, at, other);
    if (this.mode === "aims") return [this.aim("aim", at)];
    if (this.mode === "waits" && distance(this.start, at) > STILL) this.mode = "pans";
    return this.mode === "pans" ? [{ kind: "pan", dx: at[0] - before[0], dy: at[1] - before[1] }] : [];
  }

  /** To be called while a finger is down: it may have rested long enough. */
  look(now: number): Gesture[] {
    if (this.mode !== "waits" || now - this.startMs < LONG_PRESS_MS) return [];
    this.mode = "aims";
    return [this.aim("aim", this.start)];
  }

  up(id: number, at: Point): Gesture[] {
    if (!this.pointers.delete(id)) return [];
    const aimed = this.mode === "aims";
    this.mode = "over";
    return aimed ? [this.aim("goal", at), { kind: "none" }] : [];
  }

  /** The pointer was lost, or somebody wants no goal. */
  cancel(): Gesture[] {
    this.pointers.clear();
    const aimed = this.mode === "aims";
    this.mode = "over";
    return aimed ? [{ kind: "none" }] : [];
  }

  private aim(kind: "aim" | "goal", at: Point): Gesture {
    return { kind, at: this.start, towards: distance(this.start, at) >= HEADING ? at : null };
  }
}

function pinch(before: Point, at: Point, other: Point): Gesture[] {
  const factor = distance(at, other) / Math.max(1, distance(before, other));
  const middle: Point = [(at[0] + other[0]) / 2, (at[1] + other[1]) / 2];
  return [
    { kind: "pan", dx: (at[0] - before[0]) / 2, dy: (at[1] - before[1]) / 2 },
    { kind: "zoom", at: middle, factor },
  ];
}

function distance(one: Point, other: Point): number {
  return Math.hypot(one[0] - other[0], one[1] - other[1]);
}
