/** The newest `limit` entries, for tests, charts and operators' own tools. */
export class BoundedLog<T> {
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

  /** Newest first, while `wanted`. */
  newest(wanted: (entry: T) => boolean): readonly T[] {
    let first = this.entries.length;
    while (first > 0 && wanted(this.entries[first - 1] as T)) first -= 1;
    return this.entries.slice(first).reverse();
  }
}
