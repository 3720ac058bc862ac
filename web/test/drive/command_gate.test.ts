import { describe, expect, it } from "vitest";
import {
  SOUND_WAIT_MS,
  createCommandGate,
  gateState,
  nextCommand,
  noteHeard,
  noteSent,
  noteShown,
  opensAt,
  takeFeedback,
  takeRefusal,
  type CommandGate,
  type Pacing,
} from "../../src/drive/command_gate";
import { MAX_EVENT } from "../../src/gate/serial";
import { readVectors } from "../vectors";

interface Step {
  at: number;
  do: {
    feedback?: [number, number];
    sent?: boolean;
    refused?: number;
    shown?: number;
    heard?: number | null;
  };
  then: string;
  next?: { event: number; issue: number };
}

interface PacingCase {
  name: string;
  pacing: Pacing;
  tolerance: number;
  sound_tolerance?: number;
  min_interval_ms: number;
  calm_interval_ms?: number; // as min_interval_ms without
  steps: Step[];
}

const { cases } = readVectors("pacing") as { cases: PacingCase[] };

function act(gate: CommandGate, { at, do: action }: Step, soundTolerance: number): void {
  const { feedback, sent, refused, shown, heard } = action;
  if (feedback !== undefined) takeFeedback(gate, feedback[0], feedback[1]);
  if (sent === true) noteSent(gate, at);
  if (refused !== undefined) takeRefusal(gate, refused);
  if (shown !== undefined) noteShown(gate, shown);
  if (heard !== undefined)
    noteHeard(
      gate,
      [
        {
          microphone: "front",
          segment: heard === null ? null : { stamp: heard, atMs: at, leftOut: 0 },
          tolerance: soundTolerance,
        },
      ],
      at,
    );
}

/** The newest feedback and the picture on screen are of event 20. */
function openGate(pacing: Pacing): CommandGate {
  const gate = createCommandGate(pacing, 4, 0);
  takeFeedback(gate, 20, 1);
  noteShown(gate, 20);
  return gate;
}

describe("the command gate", () => {
  it("has a table of cases", () => expect(cases.length).toBeGreaterThan(15));

  it.each(cases)(
    "$name",
    ({ pacing, tolerance, sound_tolerance, min_interval_ms, calm_interval_ms, steps }) => {
      const gate = createCommandGate(pacing, tolerance, min_interval_ms, calm_interval_ms);
      for (const step of steps) {
        act(gate, step, sound_tolerance ?? 0);
        expect(gateState(gate, step.at)).toBe(step.then);
        if (step.next !== undefined) expect(nextCommand(gate)).toMatchObject(step.next);
      }
    },
  );

  it("cannot send before the first feedback", () => {
    const gate = createCommandGate("feedback", 4, 0);
    noteSent(gate, 0);
    expect(gate.inFlight).toBeNull();
    expect(nextCommand(gate)).toBeNull();
  });

  describe("with sound that is heard", () => {
    const heard = (stamp: number, tolerance = 6, microphone = "front", atMs = 0) => ({
      microphone,
      segment: { stamp, atMs, leftOut: 0 },
      tolerance,
    });
    const heardAt = (atMs: number, stamp: number) => heard(stamp, 6, "front", atMs);

    it("paced by media waits until the sound stays within tolerance when the next feedback comes", () => {
      const gate = openGate("media");
      noteHeard(gate, [heard(14)], 0);
      expect(gateState(gate, 0)).toBe("sound");
      noteHeard(gate, [heard(15)], 0);
      expect(gateState(gate, 0)).toBe("open");
    });

    it("waits for sound only while some is heard", () => {
      const gate = openGate("media");
      noteHeard(gate, [heard(1)], 0);
      expect(gateState(gate, 0)).toBe("sound");
      noteHeard(gate, [], 0);
      expect(gateState(gate, 0)).toBe("open");
    });

    it("paced by media with tolerance 0 waits for the sound of the newest event", () => {
      const gate = openGate("media");
      noteHeard(gate, [heard(19, 0)], 0);
      expect(gateState(gate, 0)).toBe("sound");
      noteHeard(gate, [heard(20, 0)], 0);
      expect(gateState(gate, 0)).toBe("open");
    });

    it("says the picture before the sound", () => {
      const gate = openGate("media");
      takeFeedback(gate, 30, 1);
      noteHeard(gate, [heard(1)], 0);
      expect(gateState(gate, 0)).toBe("picture");
    });

    it("lets no event follow sooner than the calm interval while the sound is behind by more than two thirds", () => {
      const gate = createCommandGate("feedback", 4, 16, 40);
      takeFeedback(gate, 20, 1);
      noteHeard(gate, [heard(16)], 0);
      noteSent(gate, 0);
      takeFeedback(gate, 21, 1);
      expect(gateState(gate, 16)).toBe("rate");
      expect(opensAt(gate)).toBe(40);
      noteHeard(gate, [heard(17)], 0);
      expect(gateState(gate, 16)).toBe("open");
      expect(opensAt(gate)).toBe(16);
    });

    it("paced by feedback does not wait for it before the first event, nor longer than it says", () => {
      const gate = openGate("feedback");
      noteHeard(gate, [heard(1)], 0);
      expect(gateState(gate, 0)).toBe("open");
      noteSent(gate, 0);
      takeFeedback(gate, 21, 1);
      expect(gateState(gate, SOUND_WAIT_MS - 1)).toBe("rate");
      expect(gateState(gate, SOUND_WAIT_MS)).toBe("open");
    });

    it("waits no longer for sound that was too old for three seconds, until it is not", () => {
      const gate = openGate("media");
      for (let ms = 0; ms <= 3000; ms += 100) noteHeard(gate, [heardAt(ms, 10)], ms);
      expect(gateState(gate, 3000)).toBe("sound");
      noteHeard(gate, [heardAt(3001, 11)], 3001);
      expect(gateState(gate, 3001)).toBe("open");
      noteHeard(gate, [heardAt(3500, 16)], 3500);
      noteHeard(gate, [heardAt(3600, 15)], 3600);
      noteHeard(gate, [heardAt(6500, 12)], 6500);
      expect(gateState(gate, 6600)).toBe("sound");
    });

    it("counts a segment once and its silence from its begin, however long its end is drawn out", () => {
      const gate = openGate("media");
      noteHeard(gate, [heardAt(0, 10)], 0);
      for (let ms = 16; ms < SOUND_WAIT_MS; ms += 16) {
        noteHeard(gate, [heardAt(0, 10)], ms);
        expect(gateState(gate, ms)).toBe("sound");
      }
      noteHeard(gate, [heardAt(0, 10)], SOUND_WAIT_MS);
      expect(gateState(gate, SOUND_WAIT_MS)).toBe("open");
    });

    it("paced by media waits through silence for no more than half of the robot's hold", () => {
      const gate = createCommandGate("media", 4, 0, 0, 200);
      takeFeedback(gate, 20, 1);
      noteShown(gate, 20);
      noteHeard(gate, [heardAt(0, 10)], 0);
      noteHeard(gate, [heardAt(0, 10)], 99);
      expect(gateState(gate, 99)).toBe("sound");
      noteHeard(gate, [heardAt(0, 10)], 100);
      expect(gateState(gate, 100)).toBe("open");
    });

    it("paced by media does not let a command that only lets go wait for it", () => {
      const gate = openGate("media");
      noteHeard(gate, [heard(1)], 0);
      expect(gateState(gate, 0, true)).toBe("open");
    });

    it("goes by the microphone that is farthest behind, across the wrap too", () => {
      const gate = openGate("media");
      noteHeard(gate, [heard(18), heard(15, 6, "left"), heard(19, 6, "right")], 0);
      expect(gate.heard?.stamp).toBe(15);
      takeFeedback(gate, MAX_EVENT, 1);
      takeFeedback(gate, 2, 1);
      noteHeard(gate, [heard(1), heard(MAX_EVENT - 1, 6, "left")], 0);
      expect(gate.heard?.stamp).toBe(MAX_EVENT - 1);
    });

    it("gives up one microphone on a slower path, and goes on waiting for the other", () => {
      const gate = openGate("media");
      for (let ms = 0; ms <= 3001; ms += 3001 / 30)
        noteHeard(gate, [heardAt(ms, 1), heard(15, 6, "left", ms)], ms);
      expect(gate.heard?.stamp).toBe(15);
      expect(gateState(gate, 3001)).toBe("open");
      noteHeard(gate, [heardAt(3002, 1), heard(14, 6, "left", 3002)], 3002);
      expect(gateState(gate, 3002)).toBe("sound");
      noteHeard(gate, [heard(14, 6, "left", 3003)], 3003);
      noteHeard(gate, [heardAt(3004, 1), heard(14, 6, "left", 3004)], 3004);
      expect(gate.heard?.stamp).toBe(1); // it went away and came again: it is waited for again
    });
  });
});
