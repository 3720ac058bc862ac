import { expect, it } from "vitest";
import {
  createLatency,
  noteCommandRefused,
  noteCommandSent,
  noteFeedback,
  notePicture,
} from "../../src/drive/latency";
import { MAX_EVENT } from "../../src/gate/serial";

it("the first send of an event counts, not its repeats", () => {
  const latency = createLatency();
  noteCommandSent(latency, 2, 100);
  noteCommandSent(latency, 2, 150);
  expect(noteFeedback(latency, 2, 180)).toBe(80);
});

it("a feedback that was not asked for from here is no sample", () => {
  const latency = createLatency();
  expect(noteFeedback(latency, 9, 10)).toBeNull();
  expect(latency.toFeedback.values).toEqual([]);
});

it("the first picture with the event or a later one ends the delay", () => {
  const latency = createLatency();
  noteCommandSent(latency, 2, 0);
  noteCommandSent(latency, 3, 40);
  noteCommandSent(latency, 4, 80);
  notePicture(latency, 1, 90);
  expect(latency.pictureMs).toBeNull();
  notePicture(latency, 3, 100);
  expect(latency.toPicture.values).toEqual([100, 60]);
  notePicture(latency, 3, 130);
  expect(latency.toPicture.values).toHaveLength(2);
});

it("works across the wrap", () => {
  const latency = createLatency();
  noteCommandSent(latency, MAX_EVENT, 0);
  notePicture(latency, 1, 30);
  expect(latency.pictureMs).toBe(30);
});

it("a refused event is measured anew", () => {
  const latency = createLatency();
  noteCommandSent(latency, 2, 0);
  noteCommandRefused(latency, 2);
  noteCommandSent(latency, 2, 1000);
  expect(noteFeedback(latency, 2, 1020)).toBe(20);
});

it("what is never answered is forgotten in the end", () => {
  const latency = createLatency();
  for (let event = 1; event <= 1000; event++) noteCommandSent(latency, event, event);
  expect(latency.awaitingFeedback.size).toBe(256);
  expect(latency.awaitingPicture.size).toBe(256);
});
