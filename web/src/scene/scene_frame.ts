import { confirmShown, eventOfBatch, offerUpdate, resetSceneGate, type SceneGate } from "../gate/scene_gate";
import { isRecord } from "../protocol/schema_check";

/** A key that was pressed while the scene's frame had the focus. */
export type ForeignKey = Pick<KeyboardEvent, "code" | "repeat">;

export interface SceneFrameEvents {
  due(): number | "all" | null;
  onkey(key: ForeignKey): void;
}

/**
 * Lets the scene's changes through when their event is due. The scene is viser's own client, which knows nothing of
 * events; its frame has an origin that is nobody's, so neither side reaches into the other. A script in the frame
 * (server/lockstep/server/scene/scene_frame.js) keeps each change until it is told, and says when it was shown.
 *
 * Returns what takes the listener away.
 */
export function gateScene(
  gate: SceneGate,
  frame: () => Pick<Window, "postMessage"> | null,
  events: SceneFrameEvents,
  host: Pick<Window, "addEventListener" | "removeEventListener"> = window,
): () => void {
  const sent: { id: number; event: number | null }[] = [];
  const listen = (message: MessageEvent<unknown>): void => {
    const scene = frame();
    if (scene === null || message.source !== scene || message.origin !== "null" || !isRecord(message.data))
      return;
    const { type, id, code, repeat, messages } = message.data;
    if (type === "scene_key" && typeof code === "string") events.onkey({ code, repeat: repeat === true });
    if (typeof id !== "number") return;
    if (type === "scene_connected") {
      sent.length = 0;
      resetSceneGate(gate);
    } else if (type === "scene_batch") {
      offerUpdate(gate, eventOfBatch(messages), events.due(), (event) => {
        sent.push({ id, event });
        scene.postMessage({ type: "scene_deliver", id }, "*"); // its origin has no name
      });
    } else if (type === "scene_shown") {
      for (let first = sent[0]; first !== undefined && first.id <= id; first = sent[0]) {
        sent.shift();
        confirmShown(gate, first.event);
      }
    }
  };
  host.addEventListener("message", listen);
  return () => host.removeEventListener("message", listen);
}
