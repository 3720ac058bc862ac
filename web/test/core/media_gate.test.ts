import { describe, expect, it } from "vitest";
import { judge } from "../../src/core/media_gate";
import { readVectors } from "../vectors";

interface GateCase {
  name: string;
  feedback: number | null;
  stamp: number | null;
  tolerance: number;
  enabled: boolean;
  verdict: string;
  gap: number | null;
}

const { cases } = readVectors("gate") as { cases: GateCase[] };

describe("the media gate", () => {
  it("has a table of cases", () => expect(cases.length).toBeGreaterThan(20));

  it.each(cases)("$name", ({ feedback, stamp, tolerance, enabled, verdict, gap }) => {
    expect(judge(feedback, stamp, tolerance, enabled)).toEqual({ verdict, gap });
  });
});
