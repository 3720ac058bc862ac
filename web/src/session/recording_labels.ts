import type { RecordingState } from "../protocol/wire";

export interface RecordingLabels {
  readonly text: string;
  readonly title: string;
  readonly tone: "off" | "on" | "bad";
}

const HOUR = 3600;

/** "2:05", "1:02:05". */
export function elapsed(seconds: number): string {
  const whole = Math.max(0, Math.floor(seconds));
  const two = (value: number): string => String(value).padStart(2, "0");
  const minutes = Math.floor((whole % HOUR) / 60);
  if (whole < HOUR) return `${minutes}:${two(whole % 60)}`;
  return `${Math.floor(whole / HOUR)}:${two(minutes)}:${two(whole % 60)}`;
}

/** What the page says of the recording. `seconds`: since it began. */
export function recordingLabels(
  state: RecordingState | null,
  seconds: number,
  may: boolean,
): RecordingLabels {
  if (state === null || state.state === "off")
    return { text: "Record", title: may ? "Record this session" : "", tone: "off" };
  if (state.state === "failed")
    return { text: "Not recording", title: `Recording failed: ${state.detail}`, tone: "bad" };
  const by = state.by === "" ? "" : `, started by ${state.by}`;
  const lost = state.lost > 0 ? `; the disk is too slow, ${state.lost} records are missing` : "";
  const waits = state.detail === "" ? "" : `; ${state.detail}`;
  const size = `${(state.bytes / 1e6).toFixed(state.bytes < 1e7 ? 1 : 0)} MB`;
  return {
    text: `Rec ${elapsed(seconds)}`,
    title: `This session is recorded${by}: ${size}${lost}${waits}${may ? ". Press to stop" : ""}`,
    tone: state.lost > 0 ? "bad" : "on",
  };
}
