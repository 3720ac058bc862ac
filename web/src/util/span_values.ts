/** Spans of a picture's or command's way in ms, by name; an absent one was not measured (docs/traces.md). */
type SpanValues<Name extends string> = { [name in Name]?: number };

const MAX_SPAN_MS = 600_000;

/** Notes a duration in whole microseconds, within the bounds of a span. A clock may be set between two looks at it. */
export function setSpan<Name extends string>(spans: SpanValues<Name>, name: Name, ms: number): void {
  if (Number.isFinite(ms)) spans[name] = Math.round(Math.min(Math.max(ms, 0), MAX_SPAN_MS) * 1000) / 1000;
}

/** The sum of those spans that were measured. */
export function sumOfSpans<Name extends string>(
  spans: Readonly<SpanValues<Name>>,
  names: readonly Name[],
): number {
  return names.reduce((sum, name) => sum + (spans[name] ?? 0), 0);
}
