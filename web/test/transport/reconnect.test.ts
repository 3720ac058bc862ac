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
function run(resume: Reconnect, from: number, until: number): [at: number, action: ReconnectAction][] {
  const done: [number, ReconnectAction][] = [];
  for (let now = from; now <= until; now += STEP) {
    const action = reconnectStep(resume, now);
    if (action !== null) done.push([now, action]);
  }
  return done;
}

/** Silent long enough to be asking. */
function asking(): Reconnect {
  const resume = createReconnect();
  run(resume, 0, 1500);
  return resume;
}

describe("resuming a connection", () => {
  it("leaves a console that speaks alone", () => {
    const resume = createReconnect();
    for (let now = 0; now < 5000; now += 500) {
      reconnectHeard(resume, now);
      expect(run(resume, now, now + 490)).toEqual([]);
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
    const resume = createReconnect();
    reconnectAlarm(resume, 0);
    expect(run(resume, 0, 1000)).toEqual([[700, "ask"]]);
    const later = createReconnect();
    reconnectAlarm(later, -6000);
    expect(run(later, 0, 1000)).toEqual([]);
  });

  it("does not take a page that was held up for a console that is silent", () => {
    const resume = createReconnect();
    reconnectStep(resume, 0);
    expect(reconnectStep(resume, 10_000)).toBeNull();
    expect(resume.phase).toBe("live");
  });

  it("is live again with the first message, while it asks and while it hopes", () => {
    const resume = asking();
    expect(resume.phase).toBe("asking");
    reconnectHeard(resume, 1600);
    expect(resume.phase).toBe("live");
    run(resume, 1600, 3200);
    reconnectAsked(resume, true, 3200);
    expect(resume.phase).toBe("hoping");
    reconnectHeard(resume, 3300);
    expect(run(resume, 3300, 4500)).toEqual([]);
  });

  it("restarts ICE when the console can be reached and its connection stays silent", () => {
    const resume = asking();
    reconnectAsked(resume, false, 1600);
    expect(resume.phase).toBe("asking");
    reconnectAsked(resume, true, 1700);
    expect(run(resume, 1710, 2300)).toEqual([[2100, "restart"]]);
  });

  it("connects anew when the restart is refused", () => {
    const resume = asking();
    reconnectAsked(resume, true, 1600);
    run(resume, 1610, 2100);
    expect(reconnectRestarted(resume, "refused", 2200)).toBe("reconnect");
    expect(run(resume, 2210, 9000)).toEqual([]);
    reconnectHeard(resume, 9100);
    expect(resume.phase).toBe("over");
  });

  it("connects anew when the new path brings nothing within 3 s", () => {
    const resume = asking();
    reconnectAsked(resume, true, 1600);
    run(resume, 1610, 2100);
    expect(reconnectRestarted(resume, "accepted", 2200)).toBeNull();
    expect(run(resume, 2210, 9000)).toEqual([[5200, "reconnect"]]);
  });

  it("gives a long path more time, up to ten seconds", () => {
    const resume = asking();
    reconnectAsked(resume, true, 1600, 1200);
    expect(run(resume, 1610, 3000)).toEqual([[2600, "restart"]]);
    reconnectRestarted(resume, "accepted", 4000);
    expect(run(resume, 4010, 15_000)).toEqual([[11_800, "reconnect"]]);
    const longer = asking();
    reconnectAsked(longer, true, 1600, 8000);
    expect(run(longer, 1610, 4000)).toEqual([[3600, "restart"]]);
    reconnectRestarted(longer, "accepted", 5000);
    expect(run(longer, 5010, 20_000)).toEqual([[15_000, "reconnect"]]);
  });

  it("is live again when the new path brings a message", () => {
    const resume = asking();
    reconnectAsked(resume, true, 1600);
    run(resume, 1610, 2100);
    reconnectRestarted(resume, "accepted", 2200);
    reconnectHeard(resume, 2500);
    expect([resume.phase, run(resume, 2500, 3700)]).toEqual(["live", []]);
  });

  it("asks again when the restart got no answer", () => {
    const resume = asking();
    reconnectAsked(resume, true, 1600);
    run(resume, 1610, 2100);
    expect(reconnectRestarted(resume, "unanswered", 7000)).toBeNull();
    expect(run(resume, 7010, 7500)).toEqual([[7010, "ask"]]);
  });

  it("carries a restart that was asked for to its end, also when the old path is back", () => {
    const resume = asking();
    reconnectAsked(resume, true, 1600);
    run(resume, 1610, 2100);
    reconnectHeard(resume, 2150);
    expect(resume.phase).toBe("restarting");
    reconnectRestarted(resume, "accepted", 2200);
    expect(resume.phase).toBe("moving");
  });

  it("ignores answers that come when nobody waits for them", () => {
    const resume = createReconnect();
    reconnectAsked(resume, true, 0);
    expect(reconnectRestarted(resume, "refused", 0)).toBeNull();
    expect(resume.phase).toBe("live");
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
