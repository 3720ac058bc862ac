import { describe, expect, it } from "vitest";
import { applyMessage, createConsoleState } from "../../../src/session/console_state";
import { requestAnswer } from "../../../src/session/seat/seat_notices";
import { refusalOf, seatOf } from "../../messages";

describe("the answer to a request for the seat", () => {
  it.each([
    ["declined", "declined", "Ann declined your request"],
    ["declined", "no answer", "Ann did not answer: your request is declined"],
    ["declined", "ask again a little later", "Declined just now: ask again a little later"],
    ["seat_taken", "too many people wait for the seat", "Not asked: too many people wait for the seat"],
    ["seat_taken", "", null],
    ["late", "", null],
  ] as const)("%s (%s) is told in words", (reason, detail, words) => {
    expect(requestAnswer({ ...refusalOf(0, reason), detail }, "Ann")).toBe(words);
  });

  it("names nobody when nobody is known", () => {
    expect(requestAnswer({ ...refusalOf(0, "declined"), detail: "declined" }, "")).toContain("The driver");
  });

  it("is news for the seat's bar; that it is taken is none for a page that only looked", () => {
    const state = createConsoleState();
    applyMessage(state, seatOf("ann", "Ann"), 0);
    applyMessage(state, refusalOf(0, "seat_taken"), 0);
    expect([state.seatNotice, state.log]).toEqual([null, []]);
    applyMessage(state, { ...refusalOf(0, "declined"), detail: "declined" }, 0);
    expect(state.seatNotice).toEqual({ words: "Ann declined your request" });
    expect(state.log[0]?.text).toBe("Ann declined your request");
  });
});
