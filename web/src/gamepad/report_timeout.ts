/**
 * A wireless pad that is out of range keeps its last state for seconds: stick and deadman stay held. Only the timestamp
 * of its newest report can tell, and not with every pad: many report nothing while nothing changes, so that a hand which
 * holds still looks the same as a pad that is gone. Some report all the time. Such a one is known by reports that
 * change nothing, many of them in a row; once it is known, silence means that it is gone.
 */

const ROW_GAP_MS = 250; // a longer one ends the row
const KNOWN_AFTER = 200; // reports in a row that changed nothing
const LOST_AFTER_MS = 500;
const LOOKS = 10; // since the last report: a page that was held up has not looked

export interface ReportTimeout {
  stampMs: number; // Gamepad.timestamp of the newest report; its clock is nobody's business
  values: readonly number[]; // that it brought
  reportMs: number; // when it was seen
  looks: number; // since then
  idleReports: number; // in this row
}

/** What is looked at of a Gamepad. */
export interface PadReport {
  readonly timestamp: number;
  readonly axes: readonly number[];
  readonly buttons: readonly { readonly value: number }[];
}

export function createReportTimeout(): ReportTimeout {
  return { stampMs: -1, values: [], reportMs: -Infinity, looks: 0, idleReports: 0 };
}

/** Looks at the pad; call many times a second. Says whether it has fallen silent. */
export function notePadReport(silence: ReportTimeout, pad: PadReport, now: number): boolean {
  if (pad.timestamp === silence.stampMs) {
    silence.looks += 1;
    return isSilent(silence, now);
  }
  const values = [...pad.axes, ...pad.buttons.map((button) => button.value)];
  if (now - silence.reportMs > ROW_GAP_MS) silence.idleReports = 0;
  else if (isSame(values, silence.values)) silence.idleReports += 1;
  silence.stampMs = pad.timestamp;
  silence.values = values;
  silence.reportMs = now;
  silence.looks = 0;
  return false;
}

function isSilent(silence: ReportTimeout, now: number): boolean {
  return (
    silence.idleReports >= KNOWN_AFTER && silence.looks >= LOOKS && now - silence.reportMs > LOST_AFTER_MS
  );
}

function isSame(one: readonly number[], other: readonly number[]): boolean {
  return one.length === other.length && one.every((value, at) => value === other[at]);
}
