const MOST = 200; // UTF-16 units

/** A text of a file, as it can be shown: not too long, and without what ends a line or turns the direction of others. */
export function displayText(value: unknown): string {
  return typeof value === "string"
    ? value.slice(0, MOST).replace(/[\p{Cc}\p{Cf}\p{Cs}\p{Zl}\p{Zp}]/gu, " ")
    : "";
}
