import { BoundedLog } from "../util/bounded_log";

/** One picture as it was drawn, or one segment of sound as it began to be heard. */
export interface Rendering {
  readonly stamp: number | null;
  readonly gap: number | null;
  readonly feedback: number | null; // newest event at that moment
  readonly at: number; // ms, performance.now()
  readonly age: number | null; // ms since its capture by synchronised clocks
}

/** The newest renderings of one stream. */
export class RenderLog extends BoundedLog<Rendering> {}
