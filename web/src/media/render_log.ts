/** One picture as it was drawn. */
export interface Rendering {
  readonly stamp: number | null;
  readonly gap: number | null;
  readonly feedback: number | null; // newest event at that moment
  readonly at: number; // ms, performance.now()
}

const LIMIT = 1000;

/** The newest pictures drawn on one canvas, for tests and operators' own tools. */
export class RenderLog {
  private readonly entries: Rendering[] = [];

  add(entry: Rendering): void {
    this.entries.push(entry);
    if (this.entries.length > LIMIT) this.entries.shift();
  }

  all(): readonly Rendering[] {
    return [...this.entries];
  }
}
