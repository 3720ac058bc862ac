import { describe, expect, it } from "vitest";
import { parseFleet, parseStopReplies, robotsNearby } from "../../src/fleet/fleet_status";
import { robotOf } from "./fleets";

describe("the fleet's answer", () => {
  it("takes every field that the console tells", () => {
    const robot = robotOf("arm-2", {
      stopped: true,
      stop_by: "Ann",
      stop_reason: "a door",
      driver: "Ben",
      role_may_drive: true,
      participants: [{ name: "Ben", role: "operator", driving: true }, { name: "Cy" }],
      participant_count: 7,
      gap: -1,
      tolerance: 4,
      recording: true,
      event_rate: 24.8,
      faults: ["over-temperature"],
      console: "hall-b",
      trouble: "two consoles claim it",
      has_picture: false,
    });
    expect(robot).toEqual({
      name: "arm-2",
      label: "Planar robot",
      url: "robots/arm-2/",
      link: "up",
      detail: "",
      linkAgeMs: 60_000,
      event: 12,
      stopped: true,
      stopBy: "Ann",
      stopReason: "a door",
      driver: "Ben",
      mayDrive: true,
      people: ["Ben", "Cy"],
      peopleCount: 7,
      feedbackAgeMs: 20,
      gap: -1,
      tolerance: 4,
      recording: true,
      eventRate: 24.8,
      faults: ["over-temperature"],
      console: "hall-b",
      trouble: "two consoles claim it",
      hasPicture: false,
    });
  });

  it("takes what is missing or of a wrong kind as not known", () => {
    const answer = parseFleet({
      robots: [{ name: "a", url: "robots/a/", link: "sideways", gap: "3", event_rate: NaN, participants: 4 }],
    });
    const robot = answer?.robots[0];
    expect(robot).toMatchObject({ link: "unknown", gap: null, eventRate: 0, people: [], peopleCount: 0 });
    expect(robot).toMatchObject({ mayDrive: false, stopped: false, hasPicture: true, feedbackAgeMs: null });
  });

  it("leaves out a robot without a name or address", () => {
    const robots = [{ name: "", url: "robots/a/" }, { name: "b" }, 7, null, { name: "c", url: "robots/c/" }];
    expect(parseFleet({ robots })?.robots.map(({ name }) => name)).toEqual(["c"]);
  });

  it("tells which robots of other consoles are reached under the page's own address", () => {
    const robots = [
      robotOf("own"),
      robotOf("near", { console: "yard", url: "https://entry:8443/robots/near/" }),
      robotOf("far", { console: "yard", url: "https://yard.example/robots/far/" }),
      robotOf("odd", { console: "yard", url: "https://:/" }),
    ];
    const nearby = robotsNearby(robots, "https://entry:8443/#token=x");
    expect(nearby.map(({ name }) => name)).toEqual(["near"]);
  });

  it("is none when it has no list of robots", () => {
    for (const value of [null, [], "robots", {}, { robots: {} }]) expect(parseFleet(value)).toBeNull();
  });

  it("has the notices that say something", () => {
    const notices = [
      { level: "error", text: "claimed twice" },
      { level: "odd", text: "x" },
      { level: "error" },
    ];
    expect(parseFleet({ robots: [], notices })?.notices).toEqual([
      { level: "error", text: "claimed twice" },
      { level: "warning", text: "x" },
    ]);
  });

  it("says what became of a stop at each robot", () => {
    const robots = [
      { name: "a", delivered: true, kept: true, event: 3, detail: "" },
      { name: "b", delivered: "yes", detail: "no link" },
      { delivered: true },
    ];
    expect(parseStopReplies({ robots })).toEqual([
      { name: "a", delivered: true, kept: true, detail: "" },
      { name: "b", delivered: false, kept: false, detail: "no link" },
    ]);
    expect(parseStopReplies({ delivered: true })).toBeNull();
  });
});
