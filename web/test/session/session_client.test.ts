import { describe, expect, it } from "vitest";
import { applyMessage, createConsoleState, forgetConnection } from "../../src/session/console_state";
import { SessionClient } from "../../src/session/session_client";
import type { ClientMessage, Seat } from "../../src/protocol/wire";
import { seatOf, welcomeOf } from "../messages";

interface Rig {
  readonly desk: SessionClient;
  readonly told: ClientMessage[];
  readonly connect: (role?: "observer" | "operator" | "supervisor") => void;
  readonly seat: (seat: Partial<Seat>) => void;
}

function rig(name: string | null = null): Rig {
  const told: ClientMessage[] = [];
  const state = createConsoleState();
  const desk = new SessionClient(state, name, (message) => told.push(message) > 0);
  return {
    desk,
    told,
    connect: (role = "operator") => {
      forgetConnection(state);
      applyMessage(state, welcomeOf(role), 0);
      desk.welcomed(welcomeOf(role));
    },
    seat: (seat) => {
      const before = state.handOver;
      applyMessage(state, { ...seatOf(""), ...seat }, 0);
      if (state.handOver !== before && state.handOver?.fromMe === true) desk.lostSeat();
    },
  };
}

const LATE = { peer: "late", name: "L", seconds_left: 50 };
const EARLY = { peer: "early", name: "E", seconds_left: 9 };
const ASK_IF_FREE = { type: "seat_request", only_if_free: true };

describe("a page that connects", () => {
  it("takes a free seat for an operator, and none for others", () => {
    const operator = rig("Ann");
    operator.connect();
    expect(operator.told).toEqual([{ type: "rename", name: "Ann" }, ASK_IF_FREE]);
    for (const role of ["observer", "supervisor"] as const) {
      const other = rig();
      other.connect(role);
      expect(other.told).toEqual([]);
    }
  });

  it.each(["released", "granted", "taken", "idle"])("does not take back what it gave away: %s", (why) => {
    const { told, connect, seat } = rig();
    connect();
    seat({ holder: "me" });
    seat({ holder: why === "granted" || why === "taken" ? "ben" : "", why });
    told.length = 0;
    connect();
    expect(told).toEqual([]);
  });

  it("asks again for a seat that a failing network took", () => {
    const { told, connect, seat } = rig();
    connect();
    seat({ holder: "me" });
    told.length = 0;
    seat({ holder: "", why: "heartbeat lost" });
    expect(told).toEqual([ASK_IF_FREE]);
    connect();
    expect(told).toEqual([ASK_IF_FREE, ASK_IF_FREE]);
  });

  it("asks again once the person did", () => {
    const { desk, told, connect, seat } = rig();
    connect();
    seat({ holder: "me" });
    seat({ holder: "", why: "released" });
    desk.requestSeat();
    told.length = 0;
    connect();
    expect(told).toEqual([ASK_IF_FREE]);
  });
});

describe("the holder of the seat", () => {
  it("answers whom the page shows, and nobody when nobody asks", () => {
    const { desk, told, connect, seat } = rig();
    connect();
    seat({ holder: "me" });
    told.length = 0;
    expect(desk.answerShown(true)).toBe(false);
    seat({ holder: "me", claims: [LATE, EARLY] });
    expect(desk.answerShown(true)).toBe(false); // nothing of it has been drawn yet
    desk.shownClaim = "early";
    expect(desk.answerShown(true)).toBe(true);
    expect(desk.answerShown(false)).toBe(true);
    expect(told).toEqual([
      { type: "seat_grant", peer: "early" },
      { type: "seat_decline", peer: "early" },
    ]);
    seat({ holder: "ben", claims: [LATE, EARLY] });
    expect(desk.answerShown(true)).toBe(false);
  });

  it("hands the robot to nobody who came in the place of whom the page shows", () => {
    const { desk, told, connect, seat } = rig();
    connect();
    seat({ holder: "me", claims: [LATE, EARLY] });
    desk.shownClaim = "early";
    seat({ holder: "me", claims: [LATE] });
    told.length = 0;
    expect(desk.answerShown(true)).toBe(true);
    expect(told).toEqual([]);
  });
});

describe("names and notes", () => {
  it("are cut to what the console takes, and empty ones are not sent", () => {
    const { desk, told } = rig();
    desk.rename("   ");
    expect(desk.writeNote("  \n ")).toBe(false);
    desk.rename(` ${"n".repeat(99)} `);
    expect(desk.writeNote("t".repeat(999))).toBe(true);
    expect(told).toEqual([
      { type: "rename", name: "n".repeat(60) },
      { type: "note", text: "t".repeat(500) },
    ]);
  });
});

describe("a page while a policy drives", () => {
  const DRIVES = { holder: "net", name: "net", kind: "policy", offered: true } as const;

  it.each(["operator", "supervisor"] as const)("takes over with the first press of %s", (role) => {
    const { desk, told, connect, seat } = rig();
    connect(role);
    seat(DRIVES);
    told.length = 0;
    expect(desk.takeOver()).toBe(true);
    expect(desk.answerShown(true)).toBe(true); // the key of the seat's answers does the same
    expect(told).toEqual([{ type: "seat_take" }, { type: "seat_take" }]);
  });

  it("takes nothing over by a key that declines, for an observer, or from a person", () => {
    const { desk, told, connect, seat } = rig();
    connect("operator");
    seat(DRIVES);
    told.length = 0;
    expect(desk.answerShown(false)).toBe(false);
    seat({ holder: "ann", name: "Ann", kind: "human" });
    expect(desk.takeOver()).toBe(false);
    connect("observer");
    seat(DRIVES);
    expect(desk.takeOver()).toBe(false);
    expect(told.filter((each) => each.type !== "seat_request")).toEqual([]);
  });

  it("does not take back a seat that it has offered to a policy", () => {
    const { told, connect, seat } = rig();
    connect("operator");
    seat({ holder: "me", kind: "human" });
    told.length = 0;
    seat({ holder: "", why: "offered", offered: true });
    connect("operator");
    expect(told).toEqual([]);
  });
});
