import { eventOfBatch, offerUpdate, resetSceneGate, type SceneGate } from "../core/scene_gate";
import { isRecord } from "../core/schema_check";

declare global {
  interface Window {
    /** Called by the scene's frame before any script of its own (server/scene_proxy.py). */
    lockstepScene?: (frame: Window & typeof globalThis) => void;
  }
}

/** The scene is one view of many: viser's own notices, and on a small screen its panel, would cover it. */
const STYLE = `.mantine-Notifications-root, .mantine-Notification-root { display: none !important; }
@media (max-width: 767px) { .mantine-Paper-root { display: none !important; } }`;

/**
 * Puts the gate between the scene's worker, which receives and decodes its stream, and its drawing. Both are viser's
 * own and know nothing of events.
 */
export function gateScene(gate: SceneGate, due: () => number | "all" | null): void {
  window.lockstepScene = (frame) => {
    const style = frame.document.createElement("style");
    style.textContent = STYLE;
    frame.document.head.append(style);
    frame.Worker = new Proxy(frame.Worker, {
      construct(target, args: ConstructorParameters<typeof Worker>) {
        const worker = new target(...args);
        gateMessages(worker, gate, due);
        return worker;
      },
    });
  };
}

function gateMessages(worker: Worker, gate: SceneGate, due: () => number | "all" | null): void {
  let handler: Worker["onmessage"] = null;
  Object.defineProperty(worker, "onmessage", {
    get: () => handler,
    set: (wanted: Worker["onmessage"]) => (handler = wanted),
  });
  worker.addEventListener("message", (event: MessageEvent<unknown>) => {
    const deliver = (): void => void handler?.call(worker, event);
    const data = isRecord(event.data) ? event.data : {};
    if (data["type"] === "message_batch") offerUpdate(gate, eventOfBatch(data["messages"]), due(), deliver);
    else {
      if (data["type"] === "connected") resetSceneGate(gate);
      deliver();
    }
  });
}
