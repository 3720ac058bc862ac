/** The newest `limit` entries, for tests, charts and operators' own tools. */
export class NewestLog<T> {
  private readonly entries: T[] = [];

  constructor(private readonly limit = 1000) {}

  add(entry: T): void {
    this.entries.push(entry);
    if (this.entries.length > this.limit) this.entries.shift();
  }

  /** Oldest first. */
  all(): readonly T[] {
    return [...this.entries];
  }
}
