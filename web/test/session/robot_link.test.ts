import { describe, expect, it } from "vitest";
import {
  codeLabel,
  loopbackWarning,
  parsePairingCode,
  parseRobotLink,
  refusedLabel,
  robotLinkAbout,
  robotLinkTitle,
  waitLabel,
  type RobotLink,
} from "../../src/session/robot_link";

const ANSWER = {
  dials_in: true,
  state: "unpaired",
  key: "",
  robot: "",
  by: "",
  at: 0,
  address: "",
  detail: "",
  may_pair: true,
  pairing: { state: "waiting", seconds: 581.2, tries: 5, refused: "" },
};

function link(changes: Partial<RobotLink> = {}): RobotLink {
  const found = parseRobotLink(ANSWER);
  if (found === null) throw new Error("not understood");
  return { ...found, ...changes };
}

describe("the answer of the console", () => {
  it("is read", () => {
    expect(link()).toMatchObject({
      dialsIn: true,
      state: "unpaired",
      code: "waiting",
      tries: 5,
      mayPair: true,
    });
  });

  it.each([null, 7, {}, { dials_in: "yes" }, { ...ANSWER, state: "broken" }])("is refused: %j", (answer) => {
    expect(parseRobotLink(answer)).toBeNull();
  });

  it.each([
    ["lockstep robot NAME --console ws://127.0.0.1:8000 --code K7", "127.0.0.1"],
    ["lockstep robot NAME --console wss://localhost --code K7", "localhost"],
    ["lockstep robot NAME --console ws://[::1]:8000/ --code K7", "[::1]"],
  ])("warns of a command that only a robot beside the console can use: %s", (command, host) => {
    expect(loopbackWarning(command)).toContain(`${host} in this command is the robot's own computer`);
  });

  it.each([
    "lockstep robot NAME --console wss://192.168.1.7:8000 --code K7",
    "lockstep robot NAME --console wss://localhost.example --code K7",
    "lockstep robot NAME --console wss://[fe80::1]:8000 --code K7",
    "lockstep",
  ])("does not warn of a console that is reached from elsewhere: %s", (command) => {
    expect(loopbackWarning(command)).toBe("");
  });

  it("has defaults for what is missing or of a wrong kind", () => {
    const found = parseRobotLink({ dials_in: false, state: "away", pairing: { state: "?", seconds: "x" } });
    expect(found).toMatchObject({ code: "none", seconds: 0, robot: "", mayPair: false });
  });

  it("has the robots that wait, and none of what is not understood", () => {
    const robot = { address: "10.0.0.7", since: 5, name: "planar", why: "wrong_code" };
    const waits = [robot, 7, null, { since: 1 }, { address: "10.0.0.8", name: 3, why: null }];
    expect(parseRobotLink({ ...ANSWER, waits })?.waits).toEqual([
      robot,
      { address: "10.0.0.8", since: 0, name: "", why: "" },
    ]);
    expect(parseRobotLink({ ...ANSWER, waits: "all" })?.waits).toEqual([]);
    expect(link().waits).toEqual([]);
  });

  it("has a code and its command, or none", () => {
    expect(parsePairingCode({ code: "K7", command: "lockstep" })).toEqual({
      code: "K7",
      command: "lockstep",
    });
    expect(parsePairingCode({ code: 7 })).toBeNull();
    expect(parsePairingCode(null)).toBeNull();
  });
});

describe("what people read", () => {
  it("names the robot and its state", () => {
    expect(robotLinkTitle(link())).toBe("No robot is paired");
    expect(robotLinkTitle(link({ state: "away", robot: "planar" }))).toBe("planar is away");
    expect(robotLinkTitle(link({ state: "connected" }))).toBe("The robot is connected");
  });

  it("says who paired it and from where it comes", () => {
    const paired = link({ state: "connected", key: "paired", by: "Ann", address: "192.0.2.7" });
    expect(robotLinkAbout(paired, "today")).toBe("Paired by Ann, today · from 192.0.2.7.");
    const given = link({ state: "away", key: "settings" });
    expect(robotLinkAbout(given, "")).toContain("Its key is in the console's settings · it dials in");
  });

  it("counts the code's time and tries", () => {
    expect(codeLabel(link())).toBe("Waits for the robot · good for 9:42 · 5 tries left");
    expect(codeLabel(link({ seconds: 9, tries: 1 }))).toContain("0:09 · 1 try left");
    expect(codeLabel(link({ code: "expired" }))).toContain("expired");
    expect(codeLabel(link({ code: "too_many_tries" }))).toContain("too often");
    expect(codeLabel(link({ code: "paired", state: "away" }))).toContain("Paired");
    expect(codeLabel(link({ code: "paired", state: "connected" }))).toBe("");
    expect(codeLabel(link({ code: "none" }))).toBe("");
  });

  it("says why a robot was refused, while the code is open", () => {
    expect(refusedLabel(link({ refused: "wrong_code" }))).toContain("not this one");
    expect(refusedLabel(link({ refused: "wrong_certificate" }))).toContain("certificate");
    expect(refusedLabel(link({ refused: "code_used" }))).toBe("");
    expect(refusedLabel(link({ code: "expired", refused: "wrong_code" }))).toBe("");
  });

  it("says which robot waits, why, and what lets it in", () => {
    const robot = { address: "10.0.0.7", since: 0, name: "", why: "robot_unknown" };
    const named = { ...robot, name: "planar", why: "wrong_code" };
    const none = link({ code: "none" });
    expect(waitLabel(robot, none)).toBe(
      "A robot waits at 10.0.0.7: it has no key of this console. Make a code and pair it.",
    );
    expect(waitLabel(robot, link())).toContain(
      "no key of this console. Start it with the code that is open.",
    );
    expect(waitLabel(named, none)).toContain(
      "A robot that calls itself “planar” waits at 10.0.0.7: its code",
    );
    for (const why of ["not_pairing", "code_expired", "code_used", "too_many_tries"])
      expect(waitLabel({ ...robot, why }, none)).toMatch(/code.*\. Make a code and pair it\.$/);
    expect(waitLabel({ ...robot, why: "wrong_certificate" }, none)).toContain("Somebody may be between");
    expect(waitLabel({ ...robot, why: "of tomorrow" }, none)).toContain("it was not let in");
  });

  it("says that another robot is paired, or has the key, where one waits", () => {
    const robot = { address: "10.0.0.7", since: 0, name: "", why: "robot_unknown" };
    const paired = link({ state: "connected", key: "paired", robot: "planar", code: "none" });
    expect(waitLabel(robot, paired)).toContain("planar is paired here: to pair this one instead, forget");
    expect(waitLabel(robot, { ...paired, robot: "" })).toContain("Another robot is paired here");
    expect(waitLabel(robot, { ...paired, key: "settings" })).toContain("the key in the console's settings");
    expect(waitLabel({ ...robot, name: "planar", why: "taken" }, paired)).toBe(
      "Another robot with this robot's key waits at 10.0.0.7: a second robot, or a copy of its state directory, may be running.",
    );
  });
});
