import { describe, expect, it } from "vitest";
import {
  createPress,
  isBeingSaid,
  isPast,
  outranks,
  stopDue,
  stopFate,
  tookStopAnswer,
  tookStopState,
  tookStopTaken,
  type StopPress,
} from "../../src/stop/stop_press";
import { pressedStopLabel, stopAdvice } from "../../src/stop/stop_labels";
import { stopOf } from "../messages";

const press = (first = 1): StopPress => createPress(new Uint8Array(16).fill(first), "stop key", 1000);

describe("a press of STOP", () => {
  it("has an id of 32 hex digits that all its sayings carry", () => {
    expect(
      createPress(
        Uint8Array.from({ length: 16 }, (_, at) => at * 16 + 5),
        "",
        0,
      ).id,
    ).toBe("05152535455565758595a5b5c5d5e5f5");
    expect(press(1).id).not.toBe(press(2).id);
  });

  it("is not confirmed by a stop that held already, nor by somebody else's", () => {
    const mine = press();
    tookStopState(mine, stopOf({ stopped: true, number: 7, press: "other" }), 1050);
    tookStopState(mine, stopOf({ stopped: true, number: 8, press: "another" }), 1060);
    expect(stopFate(mine, 1100)).toBe("sending");
  });

  it("is confirmed by the robot's answer to it, not by that to the person's press before", () => {
    const [earlier, mine] = [press(1), press(2)];
    tookStopTaken(mine, { press: earlier.id, number: 7, kept: true });
    expect(stopFate(mine, 1100)).toBe("sending");
    tookStopTaken(mine, { press: mine.id, number: 8, kept: true });
    expect(stopFate(mine, 1100)).toBe("confirmed");
  });

  it("is confirmed by a state that names it, and says whether that is on the robot's disk", () => {
    const mine = press();
    tookStopState(mine, stopOf({ stopped: true, number: 7, press: mine.id, kept: false }), 1100);
    expect(stopFate(mine, 2100)).toBe("not_kept");
    tookStopState(mine, stopOf({ stopped: true, number: 8, press: "other", kept: true }), 2100);
    expect(stopFate(mine, 2100)).toBe("confirmed");
    tookStopState(mine, stopOf({ stopped: true, number: 6, press: "old", kept: false }), 2200);
    expect(stopFate(mine, 9000)).toBe("confirmed");
  });

  it("is not said to be lost to the robot's disk while that still writes", () => {
    const mine = press();
    const writes = stopOf({ stopped: true, number: 7, press: mine.id, kept: false });
    tookStopState(mine, writes, 1100);
    expect(stopFate(mine, 1100)).toBe("confirmed");
    tookStopTaken(mine, { press: mine.id, number: 7, kept: true });
    tookStopState(mine, writes, 1150); // on the other channel, and later than it was said
    tookStopState(mine, { ...writes, kept: true }, 1600);
    expect([stopFate(mine, 1200), stopFate(mine, 9000)]).toEqual(["confirmed", "confirmed"]);
    tookStopTaken(mine, { press: mine.id, number: 7, kept: false }); // it has tried
    expect(stopFate(mine, 1200)).toBe("not_kept");
  });

  it("that the console keeps is waiting until the robot has it", () => {
    const mine = press();
    tookStopAnswer(mine, { kind: "waiting" });
    expect([stopFate(mine, 1100), isBeingSaid(mine, 1100)]).toEqual(["waiting", true]);
    tookStopAnswer(mine, { kind: "taken", number: 3, kept: true });
    expect(stopFate(mine, 1100)).toBe("confirmed");
  });

  it("is said to be unconfirmed after two seconds, or when the console says so, and goes on being said", () => {
    const mine = press();
    expect(stopFate(mine, 3000)).toBe("sending");
    expect(stopFate(mine, 3001)).toBe("unconfirmed");
    expect(isBeingSaid(mine, 61_000)).toBe(true);
    expect(isBeingSaid(mine, 61_001)).toBe(false);
    const other = press();
    tookStopAnswer(other, { kind: "unknown" });
    expect(stopFate(other, 1100)).toBe("sending");
    tookStopAnswer(other, { kind: "doubtful" });
    expect(stopFate(other, 1100)).toBe("unconfirmed");
  });

  it("that the console keeps is said until the robot has it, however long the robot is away", () => {
    const mine = press();
    tookStopAnswer(mine, { kind: "waiting" });
    const hour = 3_600_000;
    expect([stopFate(mine, hour), isBeingSaid(mine, hour)]).toEqual(["waiting", true]);
    expect(stopDue(mine, hour)).toEqual({ channels: true, http: true });
    expect(stopDue(mine, hour + 999)).toEqual({ channels: false, http: false });
    tookStopTaken(mine, { press: mine.id, number: 3, kept: true });
    expect([stopFate(mine, hour), isBeingSaid(mine, hour)]).toEqual(["confirmed", false]);
  });

  it("of a silenced link has had no effect and is said no more", () => {
    const mine = press();
    tookStopAnswer(mine, { kind: "silenced" });
    expect([stopFate(mine, 1100), isBeingSaid(mine, 1100)]).toEqual(["silenced", false]);
  });

  it("is said four times a second, over HTTP once, and after ten seconds once a second", () => {
    const mine = press();
    const said: [number, boolean][] = [];
    for (let now = 1000; now < 2100; now += 10) {
      const due = stopDue(mine, now);
      if (due.channels || due.http) said.push([now, due.http]);
    }
    expect(said).toEqual([
      [1000, true],
      [1250, false],
      [1500, false],
      [1750, false],
      [2000, true],
    ]);
    stopDue(mine, 11_100);
    expect(stopDue(mine, 11_400).channels).toBe(false);
    expect(stopDue(mine, 12_100).channels).toBe(true);
    tookStopTaken(mine, { press: mine.id, number: 1, kept: true });
    expect(stopDue(mine, 20_000)).toEqual({ channels: false, http: false });
  });

  it("holds the page back until the robot shows it, and is past when it was reset", () => {
    const mine = press();
    expect(outranks(mine, stopOf({ number: 4 }), 1100)).toBe(true);
    tookStopTaken(mine, { press: mine.id, number: 5, kept: true });
    expect([outranks(mine, stopOf({ number: 4 }), 1100), isPast(mine, stopOf({ number: 4 }))]).toEqual([
      true,
      false,
    ]);
    const held = stopOf({ stopped: true, number: 5 });
    expect([outranks(mine, held, 1100), isPast(mine, held)]).toEqual([false, false]);
    expect(isPast(mine, stopOf({ number: 5 }))).toBe(true);
  });

  it("tells what to do exactly when it may not have worked", () => {
    expect([stopAdvice("sending", true), stopAdvice("confirmed", false)]).toEqual([null, null]);
    for (const fate of ["not_kept", "waiting", "unconfirmed", "silenced"] as const) {
      expect(stopAdvice(fate, true)).toContain("hardware stop");
      expect(pressedStopLabel(fate, true)).not.toBe("");
    }
    expect(stopAdvice("unconfirmed", false)).toContain("Press STOP again");
  });
});
