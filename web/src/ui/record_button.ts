import type { ConsoleApp } from "../console_app";
import { mayDrive, note } from "../core/console_state";
import { recordingWords } from "../core/recording_words";
import { troubleWords, type SessionApi } from "../rtc/session_api";
import { button, h, setData, setHidden, setPressed, setText, type Panel } from "./dom";

/** Says to everyone whether the session is recorded; who may drive starts and stops it here. */
export function createRecordButton(app: ConsoleApp, api: SessionApi): Panel {
  let asking = false;
  const text = h("span", "record-text");
  const element = button("chip-button record", "", () => void toggle());
  element.append(h("span", "record-dot", { "aria-hidden": "true" }), text);

  async function toggle(): Promise<void> {
    if (asking || !mayDrive(app.state)) return;
    asking = true;
    try {
      await api.record(app.state.recording?.state !== "recording");
    } catch (error) {
      note(app.state, "error", `Recording: ${troubleWords(error)}`, Date.now());
    } finally {
      asking = false;
    }
  }

  return {
    element,
    update() {
      const { recording } = app.state;
      const may = mayDrive(app.state);
      // By two clocks that may differ: for people to read, and never below 0.
      const seconds = recording === null ? 0 : Date.now() / 1000 - recording.since;
      const words = recordingWords(recording, seconds, may);
      setHidden(element, app.state.welcome === null || (words.tone === "off" && !may));
      setData(element, "tone", words.tone);
      setPressed(element, recording?.state === "recording");
      setText(text, words.text);
      if (element.title !== words.title) element.title = words.title;
      if (element.getAttribute("aria-label") !== words.title) element.setAttribute("aria-label", words.title);
      element.disabled = asking || !may;
    },
  };
}
