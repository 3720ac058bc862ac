import { expect, test } from "vitest";

import { applyMessage, createConsoleState } from "../../src/session/console_state";
import { sourceLabel } from "../../src/session/source_labels";
import type { SourceStatus } from "../../src/protocol/wire";

const front = (state: SourceStatus["state"], detail = ""): SourceStatus => ({
  stream: "front",
  label: "Front",
  state,
  detail,
});

test("a source that works needs no words, one that does not says why", () => {
  expect(sourceLabel(front("live"))).toBeNull();
  expect(sourceLabel(front("connecting"))).toBe("Connecting…");
  expect(sourceLabel(front("reconnecting"))).toBe("Reconnecting…");
  expect(sourceLabel(front("reconnecting", "connection refused"))).toBe("Reconnecting… (connection refused)");
  expect(sourceLabel(front("waiting"))).toBe("Nobody publishes");
  expect(sourceLabel(front("waiting", "its publisher has left"))).toBe(
    "Nobody publishes (its publisher has left)",
  );
});

test("the log says who publishes a camera, and that they do no more", () => {
  const state = createConsoleState();
  const say = (...sources: SourceStatus[]): void => applyMessage(state, { type: "sources", sources }, 0);
  say(front("waiting"));
  say(front("connecting"));
  say(front("live", "published by Ann"));
  say(front("waiting", "its publisher has left"));
  expect(state.log.map((line) => line.text)).toEqual([
    "Front: Nobody publishes (its publisher has left)",
    "Front is published by Ann",
  ]);
});

test("who comes later is told by whom a camera is published", () => {
  const state = createConsoleState();
  applyMessage(state, { type: "sources", sources: [front("live", "published by Ann"), front("waiting")] }, 0);
  expect(state.log.map((line) => line.text)).toEqual(["Front is published by Ann"]);
});

test("a source that fails and comes back is logged once each; one that connects at first is not", () => {
  const state = createConsoleState();
  const say = (...sources: SourceStatus[]): void => applyMessage(state, { type: "sources", sources }, 0);
  say(front("connecting"));
  say(front("live"));
  expect(state.log).toEqual([]);
  say(front("reconnecting", "the source ended"));
  say(front("reconnecting", "connection refused"));
  say(front("live"));
  expect(state.log.map((line) => line.text)).toEqual([
    "Front is back",
    "Front: Reconnecting… (the source ended)",
  ]);
  expect(state.sources).toEqual([front("live")]);
});
