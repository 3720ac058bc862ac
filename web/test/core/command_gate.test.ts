import { describe, expect, it } from "vitest";
import {
  createCommandGate,
  gateState,
  nextCommand,
  noteSent,
  noteShown,
  takeFeedback,
  takeRefusal,
  type CommandGate,
  type Pacing,
} from "../../src/core/command_gate";
import { readVectors } from "../vectors";

interface Step {
  at: number;
  do: { feedback?: [number, number]; sent?: boolean; refused?: number; shown?: number };
  then: string;
  next?: { event: number; issue: number };
}

interface PacingCase {
  name: string;
  pacing: Pacing;
  tolerance: number;
  min_interval_ms: number;
  steps: Step[];
}

const { cases } = readVectors("pacing") as { cases: PacingCase[] };

function act(gate: CommandGate, { at, do: { feedback, sent, refused, shown } }: Step): void {
  if (feedback !== undefined) takeFeedback(gate, feedback[0], feedback[1]);
  if (sent === true) noteSent(gate, at);
  if (refused !== undefined) takeRefusal(gate, refused);
  if (shown !== undefined) noteShown(gate, shown);
}

describe("the command gate", () => {
  it("has a table of cases", () => expect(cases.length).toBeGreaterThan(15));

  it.each(cases)("$name", ({ pacing, tolerance, min_interval_ms, steps }) => {
    const gate = createCommandGate(pacing, tolerance, min_interval_ms);
    for (const step of steps) {
      act(gate, step);
      expect(gateState(gate, step.at)).toBe(step.then);
      if (step.next !== undefined) expect(nextCommand(gate)).toMatchObject(step.next);
    }
  });

  it("cannot send before the first feedback", () => {
    const gate = createCommandGate("feedback", 4, 0);
    noteSent(gate, 0);
    expect(gate.inFlight).toBeNull();
    expect(nextCommand(gate)).toBeNull();
  });
});
