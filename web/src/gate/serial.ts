/** Event references: 31-bit serial numbers (RFC 1982 with SERIAL_BITS = 31), from 1; 0 means "unset". */

const MODULUS = 2 ** 31;
const HALF = 2 ** 30;

export const MAX_EVENT = MODULUS - 1;

export function isEvent(value: number): boolean {
  return Number.isInteger(value) && value >= 1 && value <= MAX_EVENT;
}

export function eventAfter(event: number): number {
  return event < MAX_EVENT ? event + 1 : 1;
}

/** `newer - older` in serial arithmetic: -2**30 to 2**30 - 1. */
export function eventGap(newer: number, older: number): number {
  return ((((newer - older + HALF) % MODULUS) + MODULUS) % MODULUS) - HALF;
}

export function isNewer(event: number, than: number): boolean {
  return eventGap(event, than) > 0;
}
