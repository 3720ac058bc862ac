import { describe, expect, it } from "vitest";
import { applyMessage, createConsoleState } from "../../src/session/console_state";
import {
  createResetState,
  mayReset,
  noteShownStop,
  resetMessage,
  resetNotSent,
  resetNumber,
  secondsToReset,
  tookResetRefusal,
  whoResets,
} from "../../src/stop/reset_state";
import { resetRefusalLabel, takeResetWords } from "../../src/stop/reset_labels";
import { RESET_WORDS } from "../../src/stop/reset_words";
import { refusalOf, seatOf, stopOf, welcomeOf } from "../messages";

const stopped = (number: number) => stopOf({ stopped: true, number });

takeResetWords(RESET_WORDS);

describe("the offer to reset", () => {
  it("is none while no stop is on screen", () => {
    const offer = createResetState();
    expect([resetNumber(offer, 9e9), secondsToReset(offer, 9e9)]).toEqual([null, 1]);
  });

  it("names the stop that was on screen for a second when the hand came", () => {
    const offer = createResetState();
    noteShownStop(offer, stopped(7), 1000);
    expect([secondsToReset(offer, 1000), resetNumber(offer, 1999)]).toEqual([1, null]);
    noteShownStop(offer, stopped(7), 1500);
    expect([secondsToReset(offer, 2000), resetNumber(offer, 2000)]).toEqual([0, 7]);
  });

  it("resets nothing for a hand that was on the button before a newer stop came", () => {
    const offer = createResetState();
    noteShownStop(offer, stopped(7), 1000);
    noteShownStop(offer, stopped(8), 5000);
    expect([resetNumber(offer, 4500), resetNumber(offer, 5900), resetNumber(offer, 6000)]).toEqual([
      null,
      null,
      8,
    ]);
  });

  it("begins anew when something else was on screen meanwhile", () => {
    const offer = createResetState();
    noteShownStop(offer, stopped(7), 1000);
    noteShownStop(offer, null, 3000);
    noteShownStop(offer, stopped(7), 3100);
    expect(resetNumber(offer, 3500)).toBeNull();
  });

  it("says for ten seconds why a reset was refused and what to do", () => {
    const offer = createResetState();
    noteShownStop(offer, stopped(7), 1000);
    tookResetRefusal(offer, { ...refusalOf(0, "stale_reset"), stop: 7 }, 2000);
    expect(resetMessage(offer, 11_999)).toMatch(/pressed STOP again.*hold again/);
    expect(resetMessage(offer, 12_000)).toBe("");
    resetNotSent(offer, 20_000);
    expect(resetMessage(offer, 20_001)).toContain("cannot hear this page");
    noteShownStop(offer, null, 20_002);
    expect(resetMessage(offer, 20_003)).toBe("");
  });

  it.each([
    "stale_reset",
    "too_soon",
    "locked_out",
    "no_seat",
    "not_allowed",
    "too_often",
    "link_down",
  ] as const)("has words for %s", (reason) =>
    expect(resetRefusalLabel(refusalOf(0, reason))).toMatch(/^Not reset: [a-z].*\. [A-Z]/),
  );

  it("has words for a reason that is not foreseen", () => {
    expect(resetRefusalLabel(refusalOf(0, "malformed"))).toBe("Not reset: malformed.");
    expect(resetRefusalLabel({ ...refusalOf(0, "malformed"), detail: "odd" })).toBe("Not reset: odd.");
  });
});

describe("who may reset", () => {
  it("is the holder of the seat and every supervisor", () => {
    const state = createConsoleState();
    applyMessage(state, welcomeOf("operator"), 0);
    applyMessage(state, seatOf("", ""), 0);
    expect([mayReset(state), whoResets(state)]).toEqual([false, expect.stringMatching(/^Request control/)]);
    applyMessage(state, seatOf("other", "Ann"), 0);
    expect([mayReset(state), whoResets(state)]).toEqual([
      false,
      expect.stringMatching(/^Ann, who has control/),
    ]);
    applyMessage(state, seatOf("me", "somebody"), 0);
    expect(mayReset(state)).toBe(true);
    applyMessage(state, seatOf("other", "Ann"), 0);
    applyMessage(state, welcomeOf("supervisor"), 0);
    expect(mayReset(state)).toBe(true);
    applyMessage(state, welcomeOf("observer"), 0);
    applyMessage(state, seatOf("", ""), 0);
    expect([mayReset(state), whoResets(state)]).toEqual([false, expect.stringMatching(/^An operator/)]);
  });
});
