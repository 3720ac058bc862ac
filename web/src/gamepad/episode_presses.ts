import type { PadAction } from "./layout";

/** What a pad asks of the episode while its button for episodes is held. */
export type EpisodePress = "begin_or_success" | "failure" | "keep" | "discard" | "redo" | "mark";

/** The buttons that mean something else while the button for episodes is held. */
export const EPISODE_PRESSES: readonly (readonly [PadAction, EpisodePress])[] = [
  ["action_1", "begin_or_success"],
  ["action_2", "failure"],
  ["layer", "keep"],
  ["slow", "discard"],
  ["turbo", "redo"],
];
