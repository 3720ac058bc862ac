/**
 * Whether the sound device gets enough sound: its clock stands still while it gets none. A browser that asks for short
 * blocks gets them too late on a busy machine. Times in s.
 */
export interface DeviceClock {
  since: { readonly deviceS: number; readonly nowS: number } | null; // when the span began
  spans: number; // that are over
  losing: number; // of them the last ones in a row in which too much was lost
}

const SPAN_S = 4;
/** Of a span; less is caught up with unheard. */
const TOO_MUCH = 0.1;
/** A device that a browser has just opened may stand still for a second or two. */
const OPENING_SPANS = 1;
/** One is any machine's mishap. */
const SPANS_IN_A_ROW = 2;

export function createDeviceClock(): DeviceClock {
  return { since: null, spans: 0, losing: 0 };
}

/** Looks at both clocks, the sound device's and one that loses no time; says whether longer blocks would help. */
export function losesTime(clock: DeviceClock, deviceS: number, nowS: number): boolean {
  clock.since ??= { deviceS, nowS };
  const { since } = clock;
  const passed = nowS - since.nowS;
  if (passed < SPAN_S) return false;
  clock.since = { deviceS, nowS };
  clock.spans += 1;
  const lost = 1 - (deviceS - since.deviceS) / passed;
  clock.losing = clock.spans > OPENING_SPANS && lost > TOO_MUCH ? clock.losing + 1 : 0;
  return clock.losing >= SPANS_IN_A_ROW;
}
