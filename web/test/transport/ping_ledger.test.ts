import { expect, it } from "vitest";
import {
  createPingLedger,
  lostPings,
  pingAnswered,
  sendPing,
  type PingLedger,
} from "../../src/transport/ping_ledger";

it("a pong gives the round trip, once", () => {
  const pings = createPingLedger();
  const id = sendPing(pings, 1000);
  expect(pingAnswered(pings, id, 1250)).toBe(250);
  expect(pingAnswered(pings, id, 1300)).toBeNull();
});

it("a pong that answers nothing is ignored", () => {
  const pings = createPingLedger();
  expect(pingAnswered(pings, sendPing(pings, 0) + 1, 100)).toBeNull();
});

/** A page that has looked just now, and knows its round trip. */
function measured(roundTripMs: number): PingLedger {
  const pings = createPingLedger();
  lostPings(pings, -roundTripMs);
  pingAnswered(pings, sendPing(pings, -roundTripMs), 0);
  lostPings(pings, 0);
  return pings;
}

/** Looks often, as the page does; what became lost. */
function look(pings: PingLedger, from: number, until: number): number {
  let lost = 0;
  for (let now = from; now <= until; now += 100) lost += lostPings(pings, now);
  return lost;
}

it("a ping without a pong is lost once, after a second", () => {
  const pings = measured(20);
  sendPing(pings, 0);
  sendPing(pings, 500);
  expect(look(pings, 0, 1000)).toBe(0);
  expect(lostPings(pings, 1100)).toBe(1);
  expect(lostPings(pings, 1100)).toBe(0);
  expect(look(pings, 1200, 1600)).toBe(1);
});

it("an answered ping is not lost", () => {
  const pings = measured(20);
  pingAnswered(pings, sendPing(pings, 0), 900);
  expect(look(pings, 100, 3000)).toBe(0);
});

it("on a long path a ping is late and not lost, and its answer still tells the round trip", () => {
  const pings = measured(1200);
  const id = sendPing(pings, 0);
  expect(look(pings, 0, 2400)).toBe(0);
  expect(lostPings(pings, 2500)).toBe(1);
  expect(pingAnswered(pings, id, 2600)).toBe(2600);
});

it("before the first answer nothing is lost for three seconds", () => {
  const pings = createPingLedger();
  const id = sendPing(pings, 0);
  expect(look(pings, 0, 3000)).toBe(0);
  expect(pingAnswered(pings, id, 3050)).toBe(3050);
});

it("what is overdue when the page was held up is not lost, and is forgotten after ten seconds", () => {
  const pings = measured(20);
  sendPing(pings, 0);
  expect(lostPings(pings, 3000)).toBe(0);
  expect(lostPings(pings, 3500)).toBe(0);
  lostPings(pings, 10_100);
  expect(pings.out.size).toBe(0);
});
