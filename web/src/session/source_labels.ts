import type { SourceStatus } from "../protocol/wire";

/** Why an attached camera or microphone gives nothing now, in words; null when it works. */
export function sourceLabel(source: SourceStatus): string | null {
  if (source.state === "live") return null;
  if (source.state === "connecting") return "Connecting…";
  if (source.state === "waiting")
    return source.detail === "" ? "Nobody publishes" : `Nobody publishes (${source.detail})`;
  return source.detail === "" ? "Reconnecting…" : `Reconnecting… (${source.detail})`;
}
