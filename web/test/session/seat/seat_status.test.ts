import { describe, expect, it } from "vitest";
import {
  claimsAfter,
  idleSecondsAfter,
  isMeant,
  seatAction,
  seatStatus,
} from "../../../src/session/seat/seat_status";
import type { Seat } from "../../../src/protocol/wire";
import { seatOf } from "../../messages";

const CLAIMED: Seat = {
  ...seatOf("ann", "Ann"),
  claims: [
    { peer: "ben", name: "Ben", seconds_left: 59.6 },
    { peer: "cy", name: "Cy", seconds_left: 20 },
  ],
};

describe("the seat's standing", () => {
  it.each([
    [null, "me", "unknown"],
    [seatOf("", ""), null, "unknown"],
    [seatOf("", ""), "me", "free"],
    [seatOf("me", "Me"), "me", "mine"],
    [CLAIMED, "ben", "asked"],
    [CLAIMED, "dee", "held"],
  ] as const)("of %o to %s is %s", (seat, me, standing) => {
    expect(seatStatus(seat, me)).toBe(standing);
  });
});

describe("countdowns", () => {
  it("run between the console's messages and end at nothing", () => {
    expect(claimsAfter(CLAIMED, 0).map(({ name, secondsLeft }) => [name, secondsLeft])).toEqual([
      ["Cy", 20],
      ["Ben", 60],
    ]);
    expect(claimsAfter(CLAIMED, 19_500).map((claim) => claim.secondsLeft)).toEqual([1, 41]);
    expect(claimsAfter(CLAIMED, 60_000).map((claim) => claim.secondsLeft)).toEqual([0, 0]);
    expect(claimsAfter(null, 0)).toEqual([]);
  });

  it("of an idle holder are told only while there is one", () => {
    expect(idleSecondsAfter({ ...seatOf("ann"), idle_seconds_left: 30 }, 12_100)).toBe(18);
    expect(idleSecondsAfter({ ...seatOf("ann"), idle_seconds_left: 1 }, 5000)).toBe(0);
    expect(idleSecondsAfter(seatOf("ann"), 0)).toBeNull();
    expect(idleSecondsAfter({ ...seatOf(""), idle_seconds_left: 3 }, 0)).toBeNull();
    expect(idleSecondsAfter(null, 0)).toBeNull();
  });
});

describe("the button beside the seat", () => {
  it.each([
    ["operator", "free", "request", "Request control", null],
    ["operator", "held", "request", "Request control", null],
    ["operator", "asked", "withdraw", "Withdraw request", null],
    ["operator", "mine", "release", "Give control back", null],
    ["operator", "unknown", "request", "Request control", "Not connected"],
    ["supervisor", "free", "take", "Take control", null],
    ["supervisor", "held", "take", "Take control", null],
    ["supervisor", "asked", "take", "Take control", null],
    ["supervisor", "mine", "release", "Give control back", null],
    ["supervisor", "unknown", "take", "Take control", "Not connected"],
  ] as const)("of an %s is there when the seat is %s: %s", (role, standing, kind, label, why) => {
    expect(seatAction(role, standing)).toEqual({ kind, label, why });
  });

  it("is none for who may only watch", () => {
    expect(seatAction("observer", "free")).toBeNull();
    expect(seatAction(null, "unknown")).toBeNull();
  });

  it("gives back no seat that came while a finger was on its way to ask for it", () => {
    expect(isMeant("release", 120)).toBe(false);
    expect(isMeant("release", 400)).toBe(true);
    expect(isMeant("request", 0)).toBe(true);
    expect(isMeant("take", 0)).toBe(true);
  });
});

describe("the seat's button while a policy drives", () => {
  it.each([
    ["operator", "held", "take"],
    ["supervisor", "held", "take"],
    ["operator", "mine", "release"],
    ["observer", "held", undefined],
    ["policy", "held", undefined],
    ["policy", "mine", undefined],
  ] as const)("of %s, to whom it is %s, is %s", (role, status, kind) => {
    expect(seatAction(role, status, true)?.kind).toBe(kind);
  });
});
