import { describe, expect, it } from "vitest";

import type { Participant, RobotDescription, ShadowVerdict } from "../../src/protocol/wire";
import {
  policyView,
  shadowAxes,
  shadowWords,
  SLOW_MS,
  type PolicyConditions,
} from "../../src/session/policies";
import { seatOf } from "../messages";

const person = { peer: "p", name: "net", role: "policy" } as Participant;
const DRIVES = { ...seatOf("p", "net"), kind: "policy", offered: true, offered_by: "Ada" } as const;

function view(change: Partial<PolicyConditions>): ReturnType<typeof policyView> {
  return policyView({
    role: "operator",
    me: "me",
    seat: seatOf("me", "Ada"),
    participants: [person],
    silentMs: 0,
    stopped: false,
    ...change,
  });
}

describe("the bar of policies", () => {
  it("says nothing where no policy is and none drives", () => {
    expect(view({ participants: [] })).toBeNull();
    expect(view({ me: null })).toBeNull();
    expect(view({ seat: null })).toBeNull();
  });

  it("says that a policy drives, and offers everybody who may drive to take over", () => {
    for (const role of ["operator", "supervisor"] as const)
      expect(view({ seat: DRIVES, role })).toMatchObject({
        tone: "drives",
        takesOver: true,
        text: "Ada lets it",
      });
    for (const role of ["observer", "policy"] as const)
      expect(view({ seat: DRIVES, role })).toMatchObject({ tone: "drives", takesOver: false, offers: [] });
  });

  it("says that a policy is slow", () => {
    expect(view({ seat: DRIVES, silentMs: SLOW_MS - 1 })?.tone).toBe("drives");
    expect(view({ seat: DRIVES, silentMs: 1200 })).toMatchObject({
      tone: "slow",
      takesOver: true,
      text: "It has sent no command for 1.2 s",
    });
  });

  it("lets the holder give the seat to a policy, and anybody who may drive a free seat", () => {
    expect(view({})?.offers).toEqual([{ peer: "p", label: "Give to net" }]);
    expect(view({ seat: seatOf("") })?.offers).toEqual([{ peer: "p", label: "Let drive: net" }]);
    expect(view({ seat: seatOf("other", "Grace") })?.offers).toEqual([]);
    expect(view({ role: "observer" })?.offers).toEqual([]);
    expect(view({ role: "policy" })?.offers).toEqual([]);
  });

  it("lets no policy drive while the robot is stopped or somebody asks for the seat", () => {
    expect(view({ stopped: true })?.offers).toEqual([]);
    const claims = [{ peer: "other", name: "Grace", seconds_left: 60 }];
    expect(view({ seat: { ...seatOf("me", "Ada"), claims } })?.offers).toEqual([]);
  });

  it("says that an offer waits, and lets it be withdrawn", () => {
    const offered = { ...seatOf(""), offered: true, offered_to: "p", offered_by: "Ada" };
    expect(view({ seat: offered })).toMatchObject({
      tone: "offered",
      text: "Waiting for net",
      withdraws: true,
    });
    expect(view({ seat: offered, participants: [] })?.text).toBe("No policy is connected");
    expect(view({ seat: offered, role: "observer" })?.withdraws).toBe(false);
  });
});

describe("a shadow", () => {
  const axes = [
    { name: "x", label: "Forward", minimum: -1, maximum: 1, rest: 0, kind: "rate" },
    { name: "j", label: "Joint", minimum: 0, maximum: 4, rest: 0, kind: "goal" },
  ];
  const robot = { axes } as unknown as RobotDescription;
  const verdict: ShadowVerdict = {
    type: "shadow_verdict",
    peer: "p",
    name: "net",
    event: 7,
    values: [0.5, null],
    judgement: "in_time",
    difference: 0.1,
  };

  it("is shown beside what is done, as shares of the axes' ranges", () => {
    expect(shadowAxes(robot, new Set(["x", "j"]), verdict, [-1, 1])).toEqual([
      { label: "Forward", wanted: 0.75, done: 0 },
      { label: "Joint", wanted: null, done: 0.25 },
    ]);
    expect(shadowAxes(robot, new Set(["j"]), verdict, [0, 9])).toHaveLength(1);
    expect(shadowAxes(robot, new Set(["x"]), { ...verdict, values: [1e300, null] }, [null])[0]).toEqual({
      label: "Forward",
      wanted: 1,
      done: 0.5,
    });
  });

  it("has no bars where its values do not fit the robot", () => {
    expect(shadowAxes(robot, new Set(["x"]), { ...verdict, values: [1] }, [0, 0])).toEqual([]);
  });

  it("is said in words", () => {
    expect(shadowWords(verdict)).toBe("90 % as done");
    expect(shadowWords({ ...verdict, judgement: "late", difference: null })).toBe("too late");
    expect(shadowWords({ ...verdict, difference: null })).toBe("");
  });
});
