/** `window.lockstep.stats().headset`, documented in docs/console-api.md. */
export interface HeadsetStatistics {
  readonly mode: "immersive-ar" | "immersive-vr";
  readonly visibility: "hidden" | "visible" | "visible-blurred"; // of the session
  readonly frames: number; // since it began
  readonly frame_ms: number | null; // between two of them, smoothed
  readonly work_ms: number | null; // of the page in one of them, smoothed
  readonly picture_wait_ms: number | null; // of a picture, on its canvas for a frame, smoothed
  readonly held: readonly ("left" | "right")[]; // hands that let the robot move
  readonly hands: readonly { readonly side: "left" | "right"; readonly tracked: boolean }[];
  readonly panels: readonly HeadsetPanelStatistics[]; // the large one first
  readonly state: string; // as the view says it: "Driving"
  readonly text: string;
  readonly reset: string | null; // what the button says that resets a stop; null: it is not there
  readonly pointed: Readonly<Record<"left" | "right", string | null>>; // button that the hand points at
  readonly figures: Readonly<Record<string, string>>; // as the view shows them: "Gap" is "0 of 4"
  readonly way: Readonly<Record<string, number>>; // ms of each stretch from the camera to the eye: "Capture"
  readonly battery: number | null; // 0 to 1; null: not known
}

export interface HeadsetPanelStatistics {
  readonly left: string; // stream
  readonly right: string; // the same without a pair
  readonly veil: string | null; // why its picture is not the present one
}

/** A headset's session as the engine knows it. */
export interface HeadsetStep {
  step(now: number): void;
  statistics(): HeadsetStatistics;
}
