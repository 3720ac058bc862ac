import { readFileSync } from "node:fs";

/** A table of cases that the Python implementation runs too. */
export function readVectors(
  name: "clutch" | "driving" | "gate" | "goals" | "learning" | "pacing" | "poses" | "repeat" | "speed_cap",
): unknown {
  return JSON.parse(readFileSync(new URL(`../../tests/vectors/${name}.json`, import.meta.url), "utf8"));
}
