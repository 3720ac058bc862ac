import { describe, expect, it } from "vitest";
import { seatHandover } from "../../../src/session/seat/seat_handover";
import { seatOf } from "../../messages";

const FREE = seatOf("", "");
const ANN = seatOf("ann", "Ann");
const BEN = seatOf("ben", "Ben");

describe("a hand-over", () => {
  it.each([
    [FREE, BEN, "request", "Ben took the free control seat"],
    [ANN, BEN, "granted", "Ann handed control to Ben"],
    [ANN, BEN, "taken", "Ben took control from Ann"],
    [ANN, BEN, "released", "Ann gave control back: Ben has it"],
    [ANN, BEN, "idle", "Ann was idle: Ben has control"],
    [ANN, BEN, "disconnected", "Ann left: Ben has control"],
    [ANN, BEN, "heartbeat lost", "Ann fell silent: Ben has control"],
    [ANN, FREE, "released", "Ann gave control back: the control seat is free"],
    [ANN, FREE, "disconnected", "Ann left: the control seat is free"],
    [ANN, FREE, "heartbeat lost", "Ann fell silent: the control seat is free"],
    [ANN, FREE, "idle", "Ann was idle: the control seat is free"],
    [ANN, FREE, "", "Ann no longer drives: the control seat is free"],
  ])("says who and why: %o %o %s", (before, after, why, words) => {
    expect(seatHandover(before, { ...after, why }, "me")).toEqual({ words, toMe: false, fromMe: false });
  });

  it.each([
    [ANN, BEN, "granted", "ben", "Ann handed control to you", true, false],
    [ANN, BEN, "granted", "ann", "You handed control to Ben", false, true],
    [ANN, BEN, "taken", "ann", "Ben took control from you", false, true],
    [ANN, BEN, "taken", "ben", "You took control from Ann", true, false],
    [ANN, BEN, "idle", "ann", "You were idle: Ben has control", false, true],
    [ANN, BEN, "released", "ben", "Ann gave control back: you have it", true, false],
    [ANN, FREE, "idle", "ann", "You were idle: the control seat is free", false, true],
    [FREE, BEN, "request", "ben", "You took the free control seat", true, false],
  ])("speaks to those it is about: %o %o %s %s", (before, after, why, me, words, toMe, fromMe) => {
    expect(seatHandover(before, { ...after, why }, me)).toEqual({ words, toMe, fromMe });
  });

  it("is none while the same person goes on, and none in the first message of a connection", () => {
    expect(seatHandover(ANN, { ...ANN, idle_seconds_left: 3 }, "me")).toBeNull();
    expect(seatHandover(FREE, FREE, "me")).toBeNull();
    expect(seatHandover(null, ANN, "me")).toBeNull();
  });

  it("names somebody without a name", () => {
    expect(seatHandover(seatOf("x", ""), { ...seatOf("y", ""), why: "taken" }, "me")?.words).toBe(
      "Somebody took control from somebody",
    );
  });
});
