import { isSilenced } from "../core/people";
import { stopAdvice } from "../core/stop_words";
import { warningSeconds, warningWords } from "../core/start_warning";
import type { ConsoleApp } from "../console_app";
import { h, setData, setHidden, setText, type Panel } from "./dom";

interface Alarm {
  readonly tone: "bad" | "wait";
  readonly words: string;
  readonly floats?: boolean; // over the picture on small screens: nothing may move under a thumb that drives
}

/** A strip across the page for what somebody has to know to stay unhurt; the gravest only. */
export function createAlarmStrip(app: ConsoleApp): Panel {
  const element = h("div", "alarm", { role: "alert" });
  return {
    element,
    update(now) {
      const alarm = alarmOf(app, now);
      setHidden(element, alarm === null);
      setData(element, "tone", alarm?.tone ?? "wait");
      setData(element, "floats", String(alarm?.floats === true));
      setText(element, alarm?.words ?? "");
    },
  };
}

function alarmOf(app: ConsoleApp, now: number): Alarm | null {
  const fate = app.stopping.fate(now);
  const advice = fate === null ? null : stopAdvice(fate, app.stopping.isSaid(now));
  if (advice !== null) return { tone: "bad", words: advice };
  const warned = app.hears(now) ? warningSeconds(app.state.feedback, app.measuredMs, now) : 0;
  if (warned > 0) return { tone: "wait", words: warningWords(warned), floats: true };
  if (!isSilenced(app.state.participants, app.state.welcome?.peer ?? null)) return null;
  return {
    tone: "wait",
    words:
      "A supervisor silenced STOP from your link for up to ten minutes. In an emergency use the hardware stop, or call the supervisor.",
  };
}
