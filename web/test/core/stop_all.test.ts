import { describe, expect, it } from "vitest";
import {
  createStopAll,
  pressStopAll,
  putAway,
  stepStopAll,
  stopAllWords,
  stopFailed,
  tookFleet,
  tookStopReplies,
  type StopAll,
} from "../../src/core/stop_all";
import { robotOf } from "./fleets";

const STOPPED = { stopped: true, stop_by: "Ann" };
const replies = (...names: string[]) => names.map((name) => ({ name, delivered: true, detail: "" }));

function pressed(...names: string[]): StopAll {
  const stop = createStopAll();
  pressStopAll(stop, names, 1000);
  return stop;
}

describe("STOP ALL", () => {
  it("is said at once and again every second until all robots report it", () => {
    const stop = pressed("a", "b");
    expect([stepStopAll(stop, 1000), stepStopAll(stop, 1500), stepStopAll(stop, 2000)]).toEqual([
      true,
      false,
      true,
    ]);
    tookStopReplies(stop, replies("a", "b"));
    tookFleet(stop, [robotOf("a", STOPPED), robotOf("b")], 2100);
    expect(stepStopAll(stop, 3000)).toBe(true);
    tookFleet(stop, [robotOf("a", STOPPED), robotOf("b", STOPPED)], 3100);
    expect(stepStopAll(stop, 4000)).toBe(false);
    expect(stopAllWords(stop)).toMatchObject({
      tone: "done",
      title: "All 2 robots are stopped",
      missing: [],
    });
  });

  it("is not confirmed by what was asked before it was pressed", () => {
    const stop = pressed("a");
    tookStopReplies(stop, replies("a"));
    tookFleet(stop, [robotOf("a", STOPPED)], 999);
    expect(stopAllWords(stop)).toMatchObject({
      tone: "pending",
      missing: [{ name: "a", detail: "delivered, not confirmed by the robot" }],
    });
  });

  it("stays delivered when another way did not deliver it", () => {
    const stop = pressed("a");
    tookStopReplies(stop, replies("a"));
    tookStopReplies(stop, [{ name: "a", delivered: false, detail: "not confirmed: the board is silent" }]);
    expect(stopAllWords(stop)?.missing).toEqual([
      { name: "a", detail: "delivered, not confirmed by the robot" },
    ]);
  });

  it("is not confirmed by a robot whose link is down", () => {
    const stop = pressed("a");
    tookFleet(stop, [robotOf("a", { ...STOPPED, link: "down" })], 1100);
    expect(stopAllWords(stop)?.stopped).toEqual([]);
  });

  it("says at once to which it was not delivered, why, and what to do", () => {
    const stop = pressed("a", "b", "c");
    tookStopReplies(stop, [
      ...replies("a"),
      { name: "b", delivered: false, detail: "no answer from hall-b" },
      { name: "c", delivered: false, detail: "" },
    ]);
    tookFleet(stop, [robotOf("a", STOPPED)], 1200);
    const words = stopAllWords(stop);
    expect(words).toMatchObject({ tone: "bad", title: "1 of 3 robots stopped", stopped: ["a"] });
    expect(words?.missing).toEqual([
      { name: "b", detail: "not delivered: no answer from hall-b" },
      { name: "c", detail: "not delivered: it is kept and sent first when the robot is back" },
    ]);
    expect(words?.advice).toContain("emergency stops");
  });

  it("gives up after ten seconds and says that nobody confirmed it", () => {
    const stop = pressed("a");
    stopFailed(stop, "The console does not answer.");
    expect(stopAllWords(stop)).toMatchObject({
      tone: "pending",
      advice: "The console does not answer. It is said again.",
    });
    expect(stepStopAll(stop, 11_001)).toBe(false);
    expect(stopAllWords(stop)).toMatchObject({ tone: "bad", title: "STOP is not confirmed" });
    expect(stopAllWords(stop)?.advice).toMatch(/^The console does not answer\. Press again/);
  });

  it("counts a robot that the page did not know before", () => {
    const stop = pressed();
    tookStopReplies(stop, replies("a"));
    tookFleet(stop, [robotOf("a", STOPPED), robotOf("new")], 1100);
    expect(stopAllWords(stop)).toMatchObject({ tone: "pending", title: "1 of 2 robots stopped …" });
  });

  it("keeps a confirmation against a later answer, and forgets all with the next press", () => {
    const stop = pressed("a");
    tookFleet(stop, [robotOf("a", STOPPED)], 1100);
    tookStopReplies(stop, [{ name: "a", delivered: false, detail: "link down" }]);
    expect(stopAllWords(stop)?.tone).toBe("done");
    pressStopAll(stop, ["a"], 5000);
    expect(stopAllWords(stop)).toMatchObject({ tone: "pending", stopped: [] });
  });

  it("is put away when it was read", () => {
    const stop = pressed("a");
    putAway(stop);
    expect([stopAllWords(stop), stepStopAll(stop, 2000)]).toEqual([null, false]);
    tookStopReplies(stop, replies("a"));
    expect(stopAllWords(stop)).toBeNull();
  });
});
