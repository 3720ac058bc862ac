import type { ConsoleEngine } from "../../engine/console_engine";
import { mayDrive, note } from "../../session/console_state";
import { recordingLabels } from "../../session/recording_labels";
import { requestErrorLabel, type SessionApi } from "../../transport/signalling/session_api";
import { button, h, setData, setHidden, setPressed, setText, type Panel } from "../elements/dom";

/** Says to everyone whether the session is recorded; who may drive starts and stops it here. */
export function createRecordButton(engine: ConsoleEngine, api: SessionApi): Panel {
  let asking = false;
  const text = h("span", "record-text");
  const element = button("chip-button record", "", () => void toggle());
  element.append(h("span", "record-dot", { "aria-hidden": "true" }), text);

  async function toggle(): Promise<void> {
    if (asking || !mayDrive(engine.state)) return;
    asking = true;
    try {
      await api.record(engine.state.recording?.state !== "recording");
    } catch (error) {
      note(engine.state, "error", `Recording: ${requestErrorLabel(error)}`, Date.now());
    } finally {
      asking = false;
    }
  }

  return {
    element,
    update() {
      const { recording } = engine.state;
      const may = mayDrive(engine.state);
      // By two clocks that may differ: for people to read, and never below 0.
      const seconds = recording === null ? 0 : Date.now() / 1000 - recording.since;
      const words = recordingLabels(recording, seconds, may);
      setHidden(element, engine.state.welcome === null || (words.tone === "off" && !may));
      setData(element, "tone", words.tone);
      setPressed(element, recording?.state === "recording");
      setText(text, words.text);
      // The title describes the button; its name is the visible text (WCAG 2.5.3).
      if (element.title !== words.title) element.title = words.title;
      element.disabled = asking || !may;
    },
  };
}
