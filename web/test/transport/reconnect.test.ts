import { describe, expect, it } from "vitest";
import {
  createReconnect,
  reconnectAlarm,
  reconnectAsked,
  reconnectHeard,
  reconnectLabel,
  reconnectRestarted,
  reconnectStep,
  type Reconnect,
  type ReconnectAction,
} from "../../src/transport/reconnect";

const STEP = 10;

/** Steps until `until`, and what had to be done when. */
function run(reconnect: Reconnect, from: number, until: number): [at: number, action: ReconnectAction][] {
  const done: [number, ReconnectAction][] = [];
  for (let now = from; now <= until; now += STEP) {
    const action = reconnectStep(reconnect, now);
    if (action !== null) done.push([now, action]);
  }
  return done;
}

/** Silent long enough to be asking. */
function asking(): Reconnect {
  const reconnect = createReconnect();
  run(reconnect, 0, 1500);
  return reconnect;
}

describe("resuming a connection", () => {
  it("leaves a console that speaks alone", () => {
    const reconnect = createReconnect();
    for (let now = 0; now < 5000; now += 500) {
      reconnectHeard(reconnect, now);
      expect(run(reconnect, now, now + 490)).toEqual([]);
    }
  });

  it("asks once a second from 1.5 s of silence on", () => {
    expect(run(createReconnect(), 0, 4000)).toEqual([
      [1500, "ask"],
      [2500, "ask"],
      [3500, "ask"],
    ]);
  });

  it("asks sooner when the network changed, for a while", () => {
    const reconnect = createReconnect();
    reconnectAlarm(reconnect, 0);
    expect(run(reconnect, 0, 1000)).toEqual([[700, "ask"]]);
    const later = createReconnect();
    reconnectAlarm(later, -6000);
    expect(run(later, 0, 1000)).toEqual([]);
  });

  it("does not take a page that was held up for a console that is silent", () => {
    const reconnect = createReconnect();
    reconnectStep(reconnect, 0);
    expect(reconnectStep(reconnect, 10_000)).toBeNull();
    expect(reconnect.phase).toBe("live");
  });

  it("is live again with the first message, while it asks and while it hopes", () => {
    const reconnect = asking();
    expect(reconnect.phase).toBe("asking");
    reconnectHeard(reconnect, 1600);
    expect(reconnect.phase).toBe("live");
    run(reconnect, 1600, 3200);
    reconnectAsked(reconnect, true, 3200);
    expect(reconnect.phase).toBe("hoping");
    reconnectHeard(reconnect, 3300);
    expect(run(reconnect, 3300, 4500)).toEqual([]);
  });

  it("restarts ICE when the console can be reached and its connection stays silent", () => {
    const reconnect = asking();
    reconnectAsked(reconnect, false, 1600);
    expect(reconnect.phase).toBe("asking");
    reconnectAsked(reconnect, true, 1700);
    expect(run(reconnect, 1710, 2300)).toEqual([[2100, "restart"]]);
  });

  it("connects anew when the restart is refused", () => {
    const reconnect = asking();
    reconnectAsked(reconnect, true, 1600);
    run(reconnect, 1610, 2100);
    expect(reconnectRestarted(reconnect, "refused", 2200)).toBe("reconnect");
    expect(run(reconnect, 2210, 9000)).toEqual([]);
    reconnectHeard(reconnect, 9100);
    expect(reconnect.phase).toBe("over");
  });

  it("connects anew when the new path brings nothing within 3 s", () => {
    const reconnect = asking();
    reconnectAsked(reconnect, true, 1600);
    run(reconnect, 1610, 2100);
    expect(reconnectRestarted(reconnect, "accepted", 2200)).toBeNull();
    expect(run(reconnect, 2210, 9000)).toEqual([[5200, "reconnect"]]);
  });

  it("gives a long path more time, up to ten seconds", () => {
    const reconnect = asking();
    reconnectAsked(reconnect, true, 1600, 1200);
    expect(run(reconnect, 1610, 3000)).toEqual([[2600, "restart"]]);
    reconnectRestarted(reconnect, "accepted", 4000);
    expect(run(reconnect, 4010, 15_000)).toEqual([[11_800, "reconnect"]]);
    const longer = asking();
    reconnectAsked(longer, true, 1600, 8000);
    expect(run(longer, 1610, 4000)).toEqual([[3600, "restart"]]);
    reconnectRestarted(longer, "accepted", 5000);
    expect(run(longer, 5010, 20_000)).toEqual([[15_000, "reconnect"]]);
  });

  it("is live again when the new path brings a message", () => {
    const reconnect = asking();
    reconnectAsked(reconnect, true, 1600);
    run(reconnect, 1610, 2100);
    reconnectRestarted(reconnect, "accepted", 2200);
    reconnectHeard(reconnect, 2500);
    expect([reconnect.phase, run(reconnect, 2500, 3700)]).toEqual(["live", []]);
  });

  it("asks again when the restart got no answer", () => {
    const reconnect = asking();
    reconnectAsked(reconnect, true, 1600);
    run(reconnect, 1610, 2100);
    expect(reconnectRestarted(reconnect, "unanswered", 7000)).toBeNull();
    expect(run(reconnect, 7010, 7500)).toEqual([[7010, "ask"]]);
  });

  it("carries a restart that was asked for to its end, also when the old path is back", () => {
    const reconnect = asking();
    reconnectAsked(reconnect, true, 1600);
    run(reconnect, 1610, 2100);
    reconnectHeard(reconnect, 2150);
    expect(reconnect.phase).toBe("restarting");
    reconnectRestarted(reconnect, "accepted", 2200);
    expect(reconnect.phase).toBe("moving");
  });

  it("ignores answers that come when nobody waits for them", () => {
    const reconnect = createReconnect();
    reconnectAsked(reconnect, true, 0);
    expect(reconnectRestarted(reconnect, "refused", 0)).toBeNull();
    expect(reconnect.phase).toBe("live");
  });
});

it("every step back to a connection has its own words", () => {
  const phases = ["asking", "hoping", "restarting", "over"] as const;
  expect(new Set(phases.map(reconnectLabel)).size).toBe(phases.length);
  expect([reconnectLabel("live"), reconnectLabel("moving")]).toEqual([
    reconnectLabel("asking"),
    reconnectLabel("restarting"),
  ]);
});
