import { describe, expect, it } from "vitest";
import { seatLabels, type SeatView } from "../../../src/session/seat/seat_labels";

const VIEW: SeatView = {
  role: "operator",
  status: "held",
  policy: false,
  holder: "Ann",
  claims: [],
  me: "me",
  idleSeconds: null,
  armed: false,
  obstacle: null,
  notice: null,
};
const CLAIMS = [
  { peer: "ben", name: "Ben", secondsLeft: 12 },
  { peer: "cy", name: "Cy", secondsLeft: 50 },
];

describe("the seat's bar", () => {
  it("asks the holder for an answer before all else", () => {
    const words = seatLabels({ ...VIEW, status: "mine", claims: CLAIMS, idleSeconds: 9, notice: "old" });
    expect(words).toEqual({
      tone: "asked",
      title: "Ben asks for control",
      text: "12 s to answer · 1 more waits",
    });
    const three = seatLabels({ ...VIEW, status: "mine", claims: [...CLAIMS, ...CLAIMS] });
    expect(three.text).toBe("12 s to answer · 3 more wait");
  });

  it("warns the holder who is idle", () => {
    const words = seatLabels({ ...VIEW, status: "mine", idleSeconds: 24 });
    expect(words).toMatchObject({ tone: "idle", text: "Control is given back in 24 s" });
  });

  it("does not promise control to a holder who cannot drive now", () => {
    const mine = { ...VIEW, status: "mine", idleSeconds: 9 } as const;
    expect(seatLabels({ ...mine, obstacle: "silent" })).toMatchObject({
      tone: "off",
      title: "You had control",
    });
    const holding = { ...mine, idleSeconds: null };
    expect(seatLabels({ ...holding, obstacle: "robot_down" }).text).toBe("The robot cannot be reached");
    expect(seatLabels({ ...holding, obstacle: "stopped" }).text).toBe("Reset the robot, then arm to drive");
  });

  it("tells a new holder to arm, and stops telling it when armed", () => {
    const mine = { ...VIEW, status: "mine", notice: "Ann handed control to you" } as const;
    expect(seatLabels(mine)).toEqual({
      tone: "mine",
      title: "You have control",
      text: "Ann handed control to you. Arm to drive",
    });
    expect(seatLabels({ ...mine, armed: true, notice: null }).text).toBe("");
  });

  it.each([
    [{ claims: [{ peer: "me", name: "Me", secondsLeft: 43 }, ...CLAIMS] }, "You have asked: 43 s to answer"],
    [{ claims: CLAIMS }, "Ben and 1 more asked for control: 12 s to answer"],
    [{ claims: CLAIMS.slice(0, 1) }, "Ben asked for control: 12 s to answer"],
    [{ idleSeconds: 5, claims: CLAIMS }, "Ann is idle: control is free in 5 s"],
    [{ notice: "Ann took control from Ben", claims: CLAIMS }, "Ann took control from Ben"],
    [{ role: "observer" }, "You watch, and may stop the robot at any time"],
    [{ role: "supervisor" }, "You watch, and may take control at once"],
    [{}, ""],
  ] as const)("tells those who do not drive: %o", (change, text) => {
    expect(seatLabels({ ...VIEW, ...change })).toEqual({ tone: "off", title: "Ann drives", text });
  });

  it("says that nobody drives, and why", () => {
    const free = { ...VIEW, status: "free" } as const;
    expect(seatLabels(free)).toMatchObject({ tone: "free", text: "The control seat is free" });
    expect(seatLabels({ ...free, notice: "Ann left: the control seat is free" }).text).toContain("Ann left");
    expect(seatLabels({ ...free, role: "observer" }).text).toContain("You watch");
    expect(seatLabels({ ...VIEW, status: "unknown" })).toMatchObject({
      tone: "off",
      text: "Not connected",
    });
  });
});
