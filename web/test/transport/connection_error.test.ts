import { expect, it } from "vitest";
import { CONNECTION_ERROR_LABELS, connectionErrorOf } from "../../src/transport/connection_error";

it("tells apart why there is no connection", () => {
  const cases: [number, string, string][] = [
    [0, "console_unreachable", "console_unreachable"],
    [502, "http_502", "console_unreachable"],
    [503, "robot_unreachable", "robot_unreachable"],
    [503, "too_many_peers", "console_full"],
    [503, "shutting_down", "shutting_down"],
    [401, "unauthorized", "token_refused"],
    [403, "origin_refused", "origin_refused"],
    [421, "host_refused", "origin_refused"],
    [400, "bad_sdp", "refused"],
  ];
  for (const [status, error, why] of cases) expect(connectionErrorOf(status, error)).toBe(why);
});

it("says what to do about each that a person can do something about", () => {
  for (const [why, words] of Object.entries(CONNECTION_ERROR_LABELS)) {
    expect(words.title).not.toBe("");
    if (why !== "refused") expect(words.text).toMatch(/\.$/);
  }
});
