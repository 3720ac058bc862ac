import { expect, it } from "vitest";
import { createPingLedger, lostPings, pingAnswered, sendPing } from "../../src/core/ping_ledger";

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

it("a ping without a pong is lost once, after a second", () => {
  const pings = createPingLedger();
  lostPings(pings, 0);
  sendPing(pings, 0);
  lostPings(pings, 500);
  sendPing(pings, 500);
  expect(lostPings(pings, 1000)).toBe(0);
  expect(lostPings(pings, 1100)).toBe(1);
  expect(lostPings(pings, 1100)).toBe(0);
  expect(lostPings(pings, 1600)).toBe(1);
});

it("an answered ping is not lost", () => {
  const pings = createPingLedger();
  lostPings(pings, 0);
  pingAnswered(pings, sendPing(pings, 0), 900);
  lostPings(pings, 900);
  expect(lostPings(pings, 1800)).toBe(0);
});

it("what is overdue when the page was held up is forgotten, not lost", () => {
  const pings = createPingLedger();
  lostPings(pings, 0);
  sendPing(pings, 0);
  expect(lostPings(pings, 3000)).toBe(0);
  expect(lostPings(pings, 3500)).toBe(0);
  expect(pings.out.size).toBe(0);
});
