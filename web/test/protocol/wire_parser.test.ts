import { describe, expect, it } from "vitest";
import { parseServerMessage } from "../../src/protocol/wire_parser";
import { axisOf, descriptionOf, feedbackOf, seatOf, stopOf, welcomeOf } from "../messages";

const streams = [
  { mid: "0", stream: "front", label: "Front", kind: "video", codec: "VP8", carrier: "capture-time" },
];

describe("the wire parser", () => {
  it.each([
    feedbackOf(5),
    seatOf("me"),
    { ...welcomeOf("operator"), streams },
    { type: "pong", id: 4 },
    { type: "notice", level: "info", text: "hello" },
    { type: "refusal", event: 0, reason: "late", current: 3, detail: "", stop: 0 },
    { type: "participants", participants: [] },
    { type: "stop_state", stop: stopOf({ stopped: true, by: "x" }), event: 2 },
    { type: "robot", link: "up", epoch: "e", description: descriptionOf([axisOf("x")]), detail: "" },
  ])("reads a $type", (message) => {
    expect(parseServerMessage(JSON.stringify(message))).toEqual({ kind: "message", message });
  });

  it("reports a kind that it does not know", () => {
    expect(parseServerMessage('{"type":"surprise"}')).toMatchObject({ kind: "unknown", type: "surprise" });
  });

  it.each([
    ["binary", new ArrayBuffer(4)],
    ["no JSON", "{"],
    ["an array", "[]"],
    ["null", "null"],
    ["no type", "{}"],
    ["a type that is no text", '{"type":3}'],
    ["a missing field", '{"type":"pong"}'],
    ["a field of the wrong type", '{"type":"pong","id":"4"}'],
    ["a fraction where a whole number belongs", '{"type":"pong","id":1.5}'],
    ["an event out of range", JSON.stringify(feedbackOf(2 ** 31))],
    ["a list with a wrong member", JSON.stringify({ ...feedbackOf(1), axes: [1, "2"] })],
    ["a word outside its list", '{"type":"notice","level":"loud","text":""}'],
    ["a nested misfit", '{"type":"stop_state","stop":{"stopped":1,"by":"","reason":""},"event":2}'],
    ["far too long a text", `"${"x".repeat(1_000_001)}"`],
  ])("refuses %s", (_name, data) => {
    expect(parseServerMessage(data).kind).toBe("malformed");
  });

  it("says where a message does not fit", () => {
    const parsed = parseServerMessage(JSON.stringify({ ...feedbackOf(1), axes: [1, null] }));
    expect(parsed).toEqual({ kind: "malformed", detail: "message.axes[1]: not number" });
  });
});
