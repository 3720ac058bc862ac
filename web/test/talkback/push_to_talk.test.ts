import { expect, test } from "vitest";

import {
  createPushToTalk,
  IDLE_MS,
  microphoneAnswered,
  MOST_TALK_MS,
  stepTalk,
  type PushToTalk,
} from "../../src/talkback/push_to_talk";

function ready(): PushToTalk {
  const talk = createPushToTalk();
  microphoneAnswered(talk, "open", 0);
  return talk;
}

test("nothing happens, and nobody is asked, before the first press", () => {
  const talk = createPushToTalk();
  expect(stepTalk(talk, false, false, 100_000)).toBeNull();
  expect(talk.microphone).toBe("shut");
});

test("the first press asks for the microphone once, and talks if it is still held", () => {
  const talk = createPushToTalk();
  expect(stepTalk(talk, true, false, 0)).toBe("open");
  expect(stepTalk(talk, true, false, 10)).toBeNull();
  microphoneAnswered(talk, "open", 20);
  expect(stepTalk(talk, true, false, 30)).toBe("start");
  expect(stepTalk(talk, true, false, 40)).toBeNull();
  expect(stepTalk(talk, false, false, 50)).toBe("stop");
  expect(stepTalk(talk, false, false, 60)).toBeNull();
});

test("a press that was let go while the browser asked does not talk", () => {
  const talk = createPushToTalk();
  stepTalk(talk, true, false, 0);
  stepTalk(talk, false, false, 10);
  microphoneAnswered(talk, "open", 20);
  expect(stepTalk(talk, false, false, 30)).toBeNull();
  expect(talk.talking).toBe(false);
});

test("who was refused is asked again by the next press only", () => {
  const talk = createPushToTalk();
  stepTalk(talk, true, false, 0);
  microphoneAnswered(talk, "refused", 10);
  expect(stepTalk(talk, true, false, 20)).toBeNull();
  stepTalk(talk, false, false, 30);
  expect(stepTalk(talk, true, false, 40)).toBe("open");
});

test("an obstacle ends a press for good: talking does not begin again by itself", () => {
  const talk = ready();
  expect(stepTalk(talk, true, false, 0)).toBe("start");
  expect(stepTalk(talk, true, true, 10)).toBe("stop");
  expect(stepTalk(talk, true, false, 20)).toBeNull();
  stepTalk(talk, false, false, 30);
  expect(stepTalk(talk, true, false, 40)).toBe("start");
});

test("a press that began under an obstacle stays silent when that goes", () => {
  const talk = ready();
  expect(stepTalk(talk, true, true, 0)).toBeNull();
  expect(stepTalk(talk, true, false, 10)).toBeNull();
});

test("a key that is taped down is heard for a minute", () => {
  const talk = ready();
  stepTalk(talk, true, false, 0);
  expect(stepTalk(talk, true, false, MOST_TALK_MS - 1)).toBeNull();
  expect(stepTalk(talk, true, false, MOST_TALK_MS)).toBe("stop");
  expect(stepTalk(talk, true, false, MOST_TALK_MS + 10)).toBeNull();
});

test("the microphone is given back when nobody has talked for a while", () => {
  const talk = ready();
  stepTalk(talk, true, false, 0);
  stepTalk(talk, false, false, 1000);
  expect(stepTalk(talk, false, false, 1000 + IDLE_MS - 1)).toBeNull();
  expect(stepTalk(talk, false, false, 1000 + IDLE_MS)).toBe("shut");
  expect(stepTalk(talk, true, false, 1000 + IDLE_MS + 10)).toBe("open");
});
