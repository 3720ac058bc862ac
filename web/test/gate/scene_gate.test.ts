import { describe, expect, it } from "vitest";
import type { GateContext } from "../../src/gate/gate_counters";
import {
  confirmShown,
  createSceneGate,
  eventOfBatch,
  offerUpdate,
  resetSceneGate,
  sceneDue,
  sceneStaleness,
  settleScene,
} from "../../src/gate/scene_gate";
import { MAX_EVENT } from "../../src/gate/serial";

const CONTEXT: GateContext = { feedback: 10, tolerance: 4, gate: "event", wallMs: 0 };

function label(text: unknown, name = "/robot/base/event"): unknown {
  return { type: "SceneNodeUpdateMessage", name, updates: { text } };
}

describe("the 3D scene", () => {
  it("waits for the picture of its event, and shows every change up to it in order", () => {
    const gate = createSceneGate();
    const shown: string[] = [];
    const show = (words: string) => (event: number | null) => {
      shown.push(words);
      confirmShown(gate, event);
    };
    offerUpdate(gate, null, null, show("built"));
    offerUpdate(gate, 5, 4, show("5"));
    offerUpdate(gate, null, 4, show("5 too"));
    offerUpdate(gate, 7, 4, show("7"));
    expect([shown, gate.shown, gate.held.length]).toEqual([["built"], null, 3]);
    settleScene(gate, 6);
    expect([shown, gate.shown]).toEqual([["built", "5", "5 too"], 5]);
    settleScene(gate, null);
    expect(gate.shown).toBe(5);
    settleScene(gate, "all");
    expect([shown.at(-1), gate.shown, gate.held.length]).toEqual(["7", 7, 0]);
  });

  it("goes on over the wrap of the event reference", () => {
    const gate = createSceneGate();
    offerUpdate(gate, 1, MAX_EVENT, (event) => confirmShown(gate, event));
    expect(gate.shown).toBeNull();
    settleScene(gate, 2);
    expect(gate.shown).toBe(1);
  });

  it("keeps no more than so many changes: then it shows the oldest, and counts it", () => {
    const gate = createSceneGate();
    for (let event = 1; event <= 210; event++)
      offerUpdate(gate, event, null, (shown) => confirmShown(gate, shown));
    expect([gate.held.length, gate.forced, gate.shown]).toEqual([200, 10, 10]);
  });

  it("shows nothing that it does not say it shows", () => {
    const gate = createSceneGate();
    offerUpdate(gate, 3, 3, () => undefined);
    expect([gate.held.length, gate.shown]).toEqual([0, null]);
  });

  it("forgets what waited when its stream begins anew", () => {
    const gate = createSceneGate();
    offerUpdate(gate, 9, 9, () => undefined);
    offerUpdate(gate, 12, 9, () => expect.fail("it belongs to the old stream"));
    resetSceneGate(gate);
    settleScene(gate, "all");
    expect(gate.shown).toBeNull();
  });
});

describe("the scene's event", () => {
  it("is the picture's while that is within tolerance", () => {
    expect(sceneDue(CONTEXT, 8)).toBe(8);
    expect(sceneDue(CONTEXT, 12)).toBe(12);
  });

  it("is the feedback's where there is no picture to keep to", () => {
    expect(sceneDue(CONTEXT, null)).toBe(10);
    expect(sceneDue(CONTEXT, 5)).toBe(10);
    expect(sceneDue(CONTEXT, 15)).toBe(10);
    expect(sceneDue({ ...CONTEXT, feedback: null }, 5)).toBeNull();
  });

  it("is any while the gate is off", () => expect(sceneDue({ ...CONTEXT, gate: "off" }, 5)).toBe("all"));

  it.each([
    ["nothing yet", null, "Waiting for the robot's state"],
    ["within tolerance", 6, null],
    ["too old", 5, "5 events behind"],
    ["ahead within tolerance", 14, null],
    ["too new", 15, "Ahead of the robot's feedback"],
  ])("is veiled when it is not to be trusted: %s", (_, shown, words) => {
    expect(sceneStaleness({ ...createSceneGate(), shown }, CONTEXT, null)).toBe(words);
  });

  it("is veiled once its feedback is old, whatever event it shows", () => {
    const gate = { ...createSceneGate(), shown: 10 };
    expect(sceneStaleness(gate, CONTEXT, "2 s")).toBe("No feedback for 2 s");
    expect(sceneStaleness(gate, { ...CONTEXT, gate: "off" }, "2 s")).toBe("No feedback for 2 s");
    expect(sceneStaleness(createSceneGate(), CONTEXT, "2 s")).toBe("Waiting for the robot's state");
  });

  it("is not judged while the gate is off", () => {
    expect(sceneStaleness({ ...createSceneGate(), shown: 1 }, { ...CONTEXT, gate: "off" }, null)).toBeNull();
  });

  it("is read from the label in the scene, the newest of a batch", () => {
    expect(eventOfBatch([label("s 7"), { type: "SetPositionMessage" }, label("s 8 · STOPPED")])).toBe(8);
  });

  it.each([
    ["no list", null],
    ["nothing", []],
    ["no objects", [1, "s 7", null]],
    ["another node", [label("s 7", "/robot/base/other")]],
    ["another text", [label("seven")]],
    ["no text", [label(7)]],
    ["no event reference", [label("s 0"), label("s 9999999999")]],
    ["no updates", [{ type: "SceneNodeUpdateMessage", name: "/event" }]],
  ])("is none of %s", (_, messages) => expect(eventOfBatch(messages)).toBeNull());
});
