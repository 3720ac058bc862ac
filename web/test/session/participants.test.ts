import { describe, expect, it } from "vitest";
import { crowdLabel, participantLabel, sortParticipants, summarise } from "../../src/session/participants";
import { isSilenced } from "../../src/session/silenced";
import type { Participant } from "../../src/protocol/wire";
import { seatOf } from "../messages";

function person(
  peer: string,
  name: string,
  role: Participant["role"],
  rest: Partial<Participant> = {},
): Participant {
  return {
    peer,
    name,
    role,
    carrier: "capture-time",
    gap: 0,
    picture_delay_ms: null,
    round_trip_ms: null,
    loss: null,
    tier: null,
    silenced: false,
    ...rest,
  };
}

const ALL = [
  person("o2", "Zoe", "observer"),
  person("o1", "Abe", "observer"),
  person("op2", "Ben", "operator"),
  person("op3", "Cy", "operator"),
  person("sup", "Sue", "supervisor"),
  person("op1", "Ann", "operator"),
  person("me", "Me", "observer"),
];

describe("people", () => {
  it("are in the order in which they matter: who drives, you, who asks, supervisors, operators, then observers", () => {
    const seat = { ...seatOf("op1", "Ann"), claims: [{ peer: "op3", name: "Cy", seconds_left: 9 }] };
    const { leading, watching } = sortParticipants(ALL, seat, "me");
    expect(leading.map((each) => each.name)).toEqual(["Ann", "Me", "Cy", "Sue", "Ben"]);
    expect(watching.map((each) => each.name)).toEqual(["Abe", "Zoe"]);
  });

  it("watching are in the order of their names, and of one name in one order", () => {
    const sites = ["Site 10", "Site 9"].map((name) => person(name, name, "observer"));
    expect(sortParticipants(sites, null, null).watching.map((each) => each.name)).toEqual([
      "Site 9",
      "Site 10",
    ]);
    const twins = [person("b", "Twin", "observer"), person("a", "Twin", "observer")];
    expect(sortParticipants(twins, null, null).watching.map((each) => each.peer)).toEqual(["a", "b"]);
  });

  it("are summed up when they are many", () => {
    const crowd = Array.from({ length: 200 }, (_, at) =>
      person(`${at}`, `N${at}`, "observer", { gap: at === 7 ? -9 : 1, tier: at < 3 ? "low" : "high" }),
    );
    expect(crowdLabel(summarise(crowd))).toBe("200 observers · gap up to 9 · 3 on the low tier");
    expect(crowdLabel(summarise([person("x", "X", "observer")]))).toBe("1 observer");
    expect(sortParticipants(crowd, null, "5").leading).toHaveLength(1);
  });

  it("show only the figures that are known", () => {
    expect(participantLabel(person("a", "A", "operator"))).toBe("gap 0 · capture-time");
    const known = {
      gap: 2,
      picture_delay_ms: 63.7,
      round_trip_ms: 9,
      loss: 0.0042,
      tier: "operator",
    } as const;
    expect(participantLabel(person("a", "A", "operator", known))).toBe(
      "gap 2 · 64 ms · 0.4 % lost · own tier · capture-time",
    );
    expect(participantLabel(person("a", "A", "observer", { loss: 0 }))).toBe(
      "gap 0 · no loss · capture-time",
    );
    const watching = { round_trip_ms: 40.2, loss: 0.25, tier: "low", carrier: "none" } as const;
    expect(participantLabel(person("a", "A", "observer", watching))).toBe(
      "40 ms RTT · 25 % lost · low tier · no stamps",
    );
  });

  it("whose STOP is silenced stand among those who lead, and know it of themselves", () => {
    const silenced = person("o3", "Bo", "observer", { silenced: true });
    expect(sortParticipants([...ALL, silenced], null, "me").leading).toContain(silenced);
    expect([isSilenced([silenced], "o3"), isSilenced([...ALL], "me"), isSilenced([silenced], null)]).toEqual([
      true,
      false,
      false,
    ]);
  });
});
