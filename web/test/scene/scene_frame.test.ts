import { describe, expect, it } from "vitest";
import { createSceneGate, settleScene } from "../../src/gate/scene_gate";
import { gateScene, type ForeignKey } from "../../src/scene/scene_frame";

function label(event: number): unknown {
  return { type: "SceneNodeUpdateMessage", name: "/robot/event", updates: { text: `s ${event}` } };
}

/** A page with one frame, whose messages are said by hand. */
function framed() {
  const told: unknown[] = [];
  const keys: ForeignKey[] = [];
  const frame = { postMessage: (message: unknown) => void told.push(message) };
  let heard: (message: MessageEvent<unknown>) => void = () => undefined;
  const host = {
    addEventListener: (_: string, listener: typeof heard) => void (heard = listener),
    removeEventListener: () => void (heard = () => undefined),
  } as unknown as Window;
  const gate = createSceneGate();
  const due = { now: 5 as number | null };
  const close = gateScene(
    gate,
    () => frame,
    { due: () => due.now, onkey: (key) => void keys.push(key) },
    host,
  );
  const say = (data: unknown, source: unknown = frame, origin = "null"): void =>
    heard({ data, source, origin } as MessageEvent<unknown>);
  return { gate, told, keys, due, frame, say, close };
}

describe("the scene's frame", () => {
  it("is told to show a change when its event is due, and believed that it shows it when it says so", () => {
    const { gate, told, due, say } = framed();
    say({ type: "scene_connected", id: 0 });
    say({ type: "scene_batch", id: 1, messages: [] });
    say({ type: "scene_batch", id: 2, messages: [label(5)] });
    say({ type: "scene_batch", id: 3, messages: [label(6)] });
    expect(told).toEqual([
      { type: "scene_deliver", id: 1 },
      { type: "scene_deliver", id: 2 },
    ]);
    expect(gate.shown).toBeNull();
    say({ type: "scene_shown", id: 1 });
    say({ type: "scene_shown", id: 2 });
    expect([gate.shown, gate.held.length]).toEqual([5, 1]);
    due.now = 6;
    settleScene(gate, due.now);
    say({ type: "scene_shown", id: 3 });
    expect(gate.shown).toBe(6);
  });

  it("says nothing of an earlier stream once a new one has begun", () => {
    const { gate, say } = framed();
    say({ type: "scene_batch", id: 1, messages: [label(5)] });
    say({ type: "scene_connected", id: 1 });
    say({ type: "scene_shown", id: 1 });
    expect(gate.shown).toBeNull();
  });

  it("passes keys on", () => {
    const { keys, say } = framed();
    say({ type: "scene_key", code: "Space", repeat: false, ctrlKey: true });
    say({ type: "scene_key", code: 5 });
    expect(keys).toEqual([{ code: "Space", repeat: false }]);
  });

  it("is the only one that is heard, and only while it has an origin that is nobody's", () => {
    const { gate, keys, told, frame, say, close } = framed();
    say({ type: "scene_key", code: "Space" }, {});
    say({ type: "scene_key", code: "Space" }, frame, "https://console.example");
    say({ type: "scene_batch", id: 1, messages: [label(5)] }, null);
    for (const odd of [null, 5, "scene_key", [], {}, { type: "scene_batch", messages: [label(5)] }]) say(odd);
    close();
    say({ type: "scene_batch", id: 1, messages: [label(5)] });
    expect([keys, told, gate.tagged]).toEqual([[], [], null]);
  });
});
