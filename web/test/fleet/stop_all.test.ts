import { describe, expect, it } from "vitest";
import {
  createStopAll,
  pressStopAll,
  putAway,
  stepStopAll,
  stopAllLabels,
  stopFailed,
  tookFleet,
  tookStopReplies,
  type StopAll,
} from "../../src/fleet/stop_all";
import { robotOf } from "./fleets";

const STOPPED = { stopped: true, stop_by: "Ann" };
const replies = (...names: string[]) =>
  names.map((name) => ({ name, delivered: true, kept: true, detail: "" }));

const PRESS = "ab12";

function pressed(...names: string[]): StopAll {
  const stop = createStopAll();
  pressStopAll(stop, PRESS, names, 1000);
  return stop;
}

describe("STOP ALL", () => {
  it("is said at once and again every second until all robots confirm it", () => {
    const stop = pressed("a", "b");
    expect([stepStopAll(stop, 1000), stepStopAll(stop, 1500), stepStopAll(stop, 2000)]).toEqual([
      true,
      false,
      true,
    ]);
    tookStopReplies(stop, PRESS, replies("a"));
    expect(stopAllLabels(stop)).toMatchObject({
      tone: "pending",
      title: "1 of 2 robots stopped …",
      missing: [{ name: "b", detail: "not answered yet" }],
    });
    expect(stepStopAll(stop, 3000)).toBe(true);
    tookStopReplies(stop, PRESS, replies("b"));
    expect(stepStopAll(stop, 4000)).toBe(false);
    expect(stopAllLabels(stop)).toMatchObject({
      tone: "done",
      title: "All 2 robots are stopped",
      missing: [],
    });
  });

  it("is not confirmed by robots that were stopped already, nor by the answer to another press", () => {
    const stop = pressed("a");
    tookFleet(stop, [robotOf("a", STOPPED)]);
    tookStopReplies(stop, "cd34", replies("a"));
    stopFailed(stop, "cd34", "The console does not answer.");
    expect(stopAllLabels(stop)).toMatchObject({ tone: "pending", stopped: [], advice: "" });
  });

  it("stays confirmed when another way did not get through", () => {
    const stop = pressed("a");
    tookStopReplies(stop, PRESS, replies("a"));
    tookStopReplies(stop, PRESS, [
      { name: "a", delivered: false, kept: false, detail: "the board is silent" },
    ]);
    expect(stopAllLabels(stop)?.stopped).toEqual(["a"]);
  });

  it("says at once which robots it did not reach, why, and what to do", () => {
    const stop = pressed("a", "b", "c");
    tookStopReplies(stop, PRESS, [
      ...replies("a"),
      { name: "b", delivered: false, kept: false, detail: "no answer from hall-b" },
      { name: "c", delivered: false, kept: false, detail: "" },
    ]);
    const words = stopAllLabels(stop);
    expect(words).toMatchObject({ tone: "bad", title: "1 of 3 robots stopped", stopped: ["a"] });
    expect(words?.missing).toEqual([
      { name: "b", detail: "not delivered: no answer from hall-b" },
      { name: "c", detail: "not delivered: the stop is kept and sent first when the robot is back" },
    ]);
    expect(words?.advice).toContain("emergency stops");
  });

  it("says which robots are stopped and have not saved that, and what to do", () => {
    const stop = pressed("a", "b");
    tookStopReplies(stop, PRESS, [{ name: "b", delivered: true, kept: false, detail: "" }]);
    tookStopReplies(stop, PRESS, replies("a"));
    expect(stepStopAll(stop, 2000)).toBe(false);
    const words = stopAllLabels(stop);
    expect(words).toMatchObject({ tone: "bad", title: "All 2 robots are stopped, 1 NOT SAVED", missing: [] });
    expect(words).toMatchObject({ stopped: ["a", "b"], unsaved: ["b"] });
    expect(words?.advice).toMatch(/may move again when it restarts/);
    tookStopReplies(stop, PRESS, [{ name: "b", delivered: false, kept: false, detail: "" }]);
    expect(stopAllLabels(stop)?.unsaved).toEqual(["b"]);
    tookStopReplies(stop, PRESS, replies("b"));
    expect(stopAllLabels(stop)).toMatchObject({ tone: "done", title: "All 2 robots are stopped" });
  });

  it("says so of the stopped ones while others are not, too", () => {
    const stop = pressed("a", "b");
    tookStopReplies(stop, PRESS, [
      { name: "a", delivered: true, kept: false, detail: "" },
      { name: "b", delivered: false, kept: false, detail: "no link" },
    ]);
    const words = stopAllLabels(stop);
    expect(words).toMatchObject({ tone: "bad", title: "1 of 2 robots stopped", unsaved: ["a"] });
    expect(words?.advice).toMatch(/Stop the others .* may move again when it restarts/);
  });

  it("says after three seconds that nobody confirmed it, goes on for a minute, and then asks to press again", () => {
    const stop = pressed("a");
    stopFailed(stop, PRESS, "The console does not answer.");
    expect(stopAllLabels(stop)).toMatchObject({
      tone: "pending",
      advice: "The console does not answer. The page sends STOP again.",
    });
    expect(stepStopAll(stop, 4001)).toBe(true);
    expect(stopAllLabels(stop)).toMatchObject({ tone: "bad", title: "STOP is not confirmed" });
    expect(stopAllLabels(stop)?.advice).toMatch(
      /^The console does not answer\. Stop the robots with their own/,
    );
    expect(stepStopAll(stop, 61_001)).toBe(false);
    expect(stopAllLabels(stop)?.advice).toContain("Press STOP ALL");
  });

  it("names after three seconds the robot that has not confirmed it", () => {
    const stop = pressed("a", "b");
    tookStopReplies(stop, PRESS, replies("a"));
    stepStopAll(stop, 4001);
    expect(stopAllLabels(stop)).toMatchObject({
      tone: "bad",
      title: "1 of 2 robots stopped",
      stopped: ["a"],
    });
  });

  it("counts a robot that the page did not know before", () => {
    const stop = pressed();
    tookStopReplies(stop, PRESS, replies("a"));
    tookFleet(stop, [robotOf("a", STOPPED), robotOf("new")]);
    expect(stopAllLabels(stop)).toMatchObject({ tone: "pending", title: "1 of 2 robots stopped …" });
  });

  it("forgets all with the next press", () => {
    const stop = pressed("a");
    tookStopReplies(stop, PRESS, replies("a"));
    expect(stopAllLabels(stop)?.tone).toBe("done");
    pressStopAll(stop, "ef56", ["a"], 5000);
    tookStopReplies(stop, PRESS, replies("a"));
    expect(stopAllLabels(stop)).toMatchObject({ tone: "pending", stopped: [] });
  });

  it("is put away when it was read", () => {
    const stop = pressed("a");
    putAway(stop);
    expect([stopAllLabels(stop), stepStopAll(stop, 2000)]).toEqual([null, false]);
    tookStopReplies(stop, PRESS, replies("a"));
    expect(stopAllLabels(stop)).toBeNull();
  });
});
