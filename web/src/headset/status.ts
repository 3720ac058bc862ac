import { pictureSummary } from "../charts/way_summary";
import { armRefusal } from "../drive/arming";
import { ageLabel, feedbackAge } from "../drive/feedback_age";
import { ARM_REFUSAL_LABELS, disarmLabel } from "../drive/labels/labels";
import { HEADSET_DISARM_LABELS } from "./disarm_labels";
import { WAITS_LABEL } from "../drive/labels/limit_labels";
import { warningSeconds } from "../drive/labels/start_warning";
import type { ConsoleEngine } from "../engine/console_engine";
import { forceOf } from "../haptics/contact_force";
import { holdsSeat } from "../session/console_state";
import { mayReset, secondsToReset } from "../stop/reset_state";
import { grouped, milliseconds } from "../ui/elements/dom";
import { overlayLabels } from "../ui/views/overlay";
import { knownGap } from "../ui/views/view_grid";
import { wayGroups, type WayGroup } from "./way_groups";

const WAYS_OF_MS = 3000; // pictures that the shown way is the mean of

/** A value with its name and unit, as the view shows it. */
export interface Figure {
  readonly label: string;
  readonly value: string;
  readonly unit: string;
  readonly tone: "bad" | "good" | "off";
}

/** The content of the panel below the pictures. */
export interface HeadsetStatus {
  readonly tone: "armed" | "bad" | "calm" | "driving" | "stopped";
  readonly title: string;
  readonly text: string;
  readonly seat: string;
  readonly figures: readonly Figure[];
  readonly way: readonly WayGroup[];
  readonly frame: string; // "Frame 13.9 ms, of which 2.1 ms work"
}

/** The times that the session itself measures. */
export interface FrameFigures {
  readonly intervalMs: number | null; // between the newest frames
  readonly workMs: number | null; // of the page in one
  readonly waitedMs: number | null; // a picture, on its canvas for a frame
}

/** The page's state in the few words that fit into a view. `stream`: of the large picture. */
export function headsetStatus(
  engine: ConsoleEngine,
  stream: string | null,
  frame: FrameFigures,
  now: number,
): HeadsetStatus {
  return {
    ...stateWords(engine, now),
    seat: seatWords(engine),
    figures: figuresOf(engine, stream, now),
    way: wayOf(engine, stream, frame, now),
    frame: `Frame ${milliseconds(frame.intervalMs)} ms, of which ${milliseconds(frame.workMs)} ms work`,
  };
}

/** The text of the button that resets a stop; null where there is nothing to reset, or it is not this person's. */
export function resetWords(engine: ConsoleEngine, now: number): { text: string; ready: boolean } | null {
  const { stop } = engine.state;
  const isShown = overlayLabels(engine, now)?.tone === "stopped";
  if (!isShown || stop.locked_out !== "" || !mayReset(engine.state)) return null;
  const seconds = secondsToReset(engine.stopping.resetState, now);
  return seconds === 0
    ? { text: "Hold to reset", ready: true }
    : { text: `Look first: ${seconds} s`, ready: false };
}

function stateWords(engine: ConsoleEngine, now: number): Pick<HeadsetStatus, "text" | "title" | "tone"> {
  const grave = overlayLabels(engine, now);
  if (grave !== null) {
    const text = [grave.warning ?? "", grave.text].filter((each) => each !== "").join(" ");
    return { tone: grave.tone === "stopped" ? "stopped" : grave.tone, title: grave.title, text };
  }
  const { arming } = engine.driving;
  const warned = warningSeconds(engine.state.feedback, engine.measuredMs, now);
  if (engine.driving.isArmed() && warned > 0)
    return { tone: "armed", title: "Armed", text: `The robot warns first: ${warned} s` };
  if (arming.state === "driving") {
    const waits = engine.driving.goals?.saysWhatItWaitsFor(now) === true;
    const text = waits ? WAITS_LABEL : "Let go of the grip to bring the robot to rest";
    return { tone: "driving", title: "Driving", text };
  }
  if (arming.state === "armed") return { tone: "armed", title: "Armed", text: "Squeeze the grip to drive" };
  const refusal = armRefusal(arming, engine.conditions(now));
  const text =
    refusal === null || refusal === "deadman_held" ? calmWords(engine) : ARM_REFUSAL_LABELS[refusal];
  return { tone: "calm", title: "Disarmed", text };
}

function calmWords({ driving }: ConsoleEngine): string {
  const { reason } = driving.arming;
  const squeeze = HEADSET_DISARM_LABELS.squeeze_released;
  if (reason === "start" || reason === "operator" || reason === "squeeze_released") return squeeze;
  const why = disarmLabel(reason).replace(/^Disarmed: (.)/, (_all, first: string) => first.toUpperCase());
  return `${why.replace(". Arm to go on", "")}. ${squeeze}`;
}

function seatWords({ state }: ConsoleEngine): string {
  if (state.welcome === null) return "";
  if (holdsSeat(state)) return "You have control";
  const holder = state.seat?.name ?? "";
  return holder === "" ? "Nobody has control" : `${holder} has control`;
}

function figuresOf(engine: ConsoleEngine, stream: string | null, now: number): Figure[] {
  const { state } = engine;
  const { feedback, robot, settings } = state;
  const age = feedbackAge(engine.measuredMs, now);
  const gap = stream === null ? null : knownGap(engine, stream, now);
  const tolerance = settings.tolerance.video;
  const layer = robot?.description.layers[engine.driving.layer];
  const figures: Figure[] = [
    {
      label: age === null ? "Event" : `Event, ${ageLabel(now - (engine.measuredMs ?? now))} old`,
      value: feedback === null ? "–" : grouped(feedback.event),
      unit: "",
      tone: age === null ? "good" : "bad",
    },
    {
      label: settings.gate === "event" ? "Gap" : "Gap, the gate is off",
      value: gap === null ? "–" : String(gap),
      unit: `of ${tolerance}`,
      tone: settings.gate !== "event" || (gap !== null && Math.abs(gap) > tolerance) ? "bad" : "good",
    },
    {
      label: "Delay",
      value: milliseconds(engine.driving.viewDelayMs),
      unit: "ms",
      tone: engine.driving.viewDelayMs === null ? "off" : "good",
    },
  ];
  if (robot !== null && robot.description.wrench !== null)
    figures.push({
      label: "Force",
      value: feedback === null || age !== null ? "–" : forceOf(feedback.wrench).toFixed(1),
      unit: "N",
      tone: "good",
    });
  if ((robot?.description.layers.length ?? 0) > 1 && layer !== undefined)
    figures.push({ label: "Layer", value: layer.label, unit: "", tone: "good" });
  if (engine.driving.speedShare < 1)
    figures.push({
      label: "Speed",
      value: String(Math.round(engine.driving.speedShare * 100)),
      unit: "%",
      tone: "good",
    });
  return figures;
}

function wayOf(engine: ConsoleEngine, stream: string | null, frame: FrameFigures, now: number): WayGroup[] {
  const book = engine.tracing?.book;
  const summary =
    stream === null || book === undefined ? null : pictureSummary(book, stream, now - WAYS_OF_MS, now);
  return wayGroups(summary, frame.waitedMs);
}
