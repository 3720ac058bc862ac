import { isSilenced } from "../../session/silenced";
import { stopAdvice } from "../../stop/stop_labels";
import { warningSeconds, warningLabel } from "../../drive/labels/start_warning";
import type { ConsoleEngine } from "../../engine/console_engine";
import { h, setData, setHidden, setText, type Panel } from "../elements/dom";

interface Alarm {
  readonly tone: "bad" | "wait";
  readonly words: string;
  readonly floats?: boolean; // over the picture on small screens: nothing may move under a thumb that drives
}

/** A strip across the page for what somebody has to know to stay unhurt; the gravest only. */
export function createAlarmStrip(engine: ConsoleEngine): Panel {
  const element = h("div", "alarm", { role: "alert" });
  return {
    element,
    update(now) {
      const alarm = alarmOf(engine, now);
      setHidden(element, alarm === null);
      setData(element, "tone", alarm?.tone ?? "wait");
      setData(element, "floats", String(alarm?.floats === true));
      setText(element, alarm?.words ?? "");
    },
  };
}

function alarmOf(engine: ConsoleEngine, now: number): Alarm | null {
  const fate = engine.stopping.fate(now);
  const advice = fate === null ? null : stopAdvice(fate, engine.stopping.isSaid(now));
  if (advice !== null) return { tone: "bad", words: advice };
  const warned = engine.hears(now) ? warningSeconds(engine.state.feedback, engine.measuredMs, now) : 0;
  if (warned > 0) return { tone: "wait", words: warningLabel(warned), floats: true };
  if (!isSilenced(engine.state.participants, engine.state.welcome?.peer ?? null)) return null;
  return {
    tone: "wait",
    words:
      "A supervisor silenced STOP from your link for up to ten minutes. In an emergency use the hardware stop, or call the supervisor.",
  };
}
