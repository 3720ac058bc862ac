/** How long one press talks at most: a key that is taped down must not keep a microphone open. */
export const MOST_TALK_MS = 60_000;
/** The microphone is given back after so long without a word. */
export const IDLE_MS = 30_000;

export type MicrophoneState = "shut" | "asking" | "open" | "refused" | "missing";

/** The talk button of one page. */
export interface PushToTalk {
  microphone: MicrophoneState;
  talking: boolean;
  spent: boolean; // this press has ended although it is still held
  sinceMs: number; // of the press that talks
  quietMs: number; // when it last ended
}

/** What is to be done with the microphone now. */
export type TalkAction = "open" | "start" | "stop" | "shut";

export function createPushToTalk(): PushToTalk {
  return { microphone: "shut", talking: false, spent: false, sinceMs: 0, quietMs: 0 };
}

/**
 * Call often. `obstacle`: nothing may be said now. What ends a press, be it its length, lasts until it is let go: a
 * microphone never opens by itself.
 */
export function stepTalk(
  talk: PushToTalk,
  held: boolean,
  obstacle: boolean,
  nowMs: number,
): TalkAction | null {
  if (!held) talk.spent = false;
  else if (obstacle) talk.spent = true;
  if (talk.talking) {
    if (held && !obstacle && nowMs - talk.sinceMs < MOST_TALK_MS) return null;
    talk.spent = held;
    talk.talking = false;
    talk.quietMs = nowMs;
    return "stop";
  }
  if (held && !talk.spent) return begin(talk, nowMs);
  if (talk.microphone !== "open" || nowMs - talk.quietMs < IDLE_MS) return null;
  talk.microphone = "shut";
  return "shut";
}

function begin(talk: PushToTalk, nowMs: number): TalkAction | null {
  if (talk.microphone === "asking") return null;
  if (talk.microphone !== "open") {
    talk.microphone = "asking";
    return "open";
  }
  talk.talking = true;
  talk.sinceMs = nowMs;
  return "start";
}

/** The browser has answered. Who was refused is asked again by the next press only. */
export function microphoneAnswered(talk: PushToTalk, answer: MicrophoneState, nowMs: number): void {
  talk.microphone = answer;
  talk.quietMs = nowMs;
  if (answer !== "open") talk.spent = true;
}
