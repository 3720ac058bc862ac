import { describe, expect, it } from "vitest";
import { judge, type GateMode } from "../../src/gate/media_gate";
import { readVectors } from "../vectors";

interface GateCase {
  name: string;
  feedback: number | null;
  stamp: number | null;
  tolerance: number;
  mode: GateMode;
  verdict: string;
  gap: number | null;
}

const { cases } = readVectors("gate") as { cases: GateCase[] };

describe("the media gate", () => {
  it("has a table of cases", () => expect(cases.length).toBeGreaterThan(20));

  it.each(cases)("$name", ({ feedback, stamp, tolerance, mode, verdict, gap }) => {
    expect(judge(feedback, stamp, tolerance, mode)).toEqual({ verdict, gap });
  });
});
