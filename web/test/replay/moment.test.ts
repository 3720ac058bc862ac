import { describe, expect, it } from "vitest";
import { brokenChunk, ChunkBroken, parseChunkBody, type ReplayRecord } from "../../src/replay/chunk";
import {
  chunksOf,
  grownIndex,
  keyframeBefore,
  parseIndex,
  type ReplayIndex,
} from "../../src/replay/index_table";
import { eventAtTime, momentOf, soundRuns } from "../../src/replay/moment";

interface Part {
  readonly topic: string;
  readonly event: number;
  readonly arrived: number;
  readonly keyframe?: boolean;
  readonly format?: string;
  readonly payload: string;
}

/** The body of a chunk as the console sends it. */
function bodyOf(parts: readonly Part[]): ArrayBuffer {
  const encoder = new TextEncoder();
  const pieces = parts.flatMap(({ payload, ...head }) => {
    const data = encoder.encode(payload);
    const header = encoder.encode(
      JSON.stringify({ keyframe: true, captured: 0, ...head, size: data.length }),
    );
    const length = new Uint8Array(4);
    new DataView(length.buffer).setUint32(0, header.length);
    return [length, header, data];
  });
  const whole = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
  let at = 0;
  for (const piece of pieces) {
    whole.set(piece, at);
    at += piece.length;
  }
  return whole.buffer;
}

const picture = (event: number, arrived: number, keyframe: boolean): Part => ({
  topic: "/camera/front",
  event,
  arrived,
  keyframe,
  payload: `${arrived}`,
});
const feedback = (event: number, issue: number, arrived: number): Part => ({
  topic: "/lockstep/feedback",
  event,
  arrived,
  payload: JSON.stringify({ event, issue, axes: [arrived] }),
});
const command = (event: number, arrived: number, outcome: string, value: number): Part => ({
  topic: "/lockstep/command",
  event,
  arrived,
  payload: JSON.stringify({ event, issue: 1, values: [value], outcome, name: "Ada" }),
});

const chunks = [
  parseChunkBody(
    0,
    bodyOf([picture(4, 10, true), feedback(5, 1, 20), picture(5, 25, false), feedback(5, 2, 30)]),
  ),
  parseChunkBody(
    1,
    bodyOf([
      command(6, 38, "refused", 0.9),
      command(6, 39, "forwarded", 0.1),
      command(6, 40, "forwarded", 0.2),
      feedback(6, 1, 50),
      picture(5, 52, false),
      picture(7, 60, false),
    ]),
  ),
];

describe("the records of a robot with goal axes", () => {
  it("keep null where an axis stays, and the goals that were applied", () => {
    const parts: Part[] = [
      {
        topic: "/lockstep/command",
        event: 5,
        arrived: 10,
        payload: JSON.stringify({
          event: 5,
          issue: 1,
          values: [0.5, null],
          outcome: "forwarded",
          name: "Ada",
        }),
      },
      {
        topic: "/lockstep/feedback",
        event: 5,
        arrived: 20,
        payload: JSON.stringify({ event: 5, issue: 1, axes: [0.5, 1], goals: [null, 1.25] }),
      },
    ];
    const chunk = parseChunkBody(0, bodyOf(parts));
    expect(chunk.commands[0]?.values).toEqual([0.5, null]);
    expect(chunk.feedback[0]?.goals).toEqual([null, 1.25]);
    expect(parseChunkBody(0, bodyOf([feedback(1, 1, 1)])).feedback[0]?.goals).toEqual([]);
  });
});

describe("a moment", () => {
  it("has the newest picture that is not newer than its event, and what comes before that back to a keyframe", () => {
    const found = momentOf(chunks, { event: 6, until: null }).pictures.get("/camera/front");
    expect(found?.record.arrived).toBe(52);
    expect(found?.sequence.map((each) => each.arrived)).toEqual([10, 25, 52]);
  });

  it("has the newest issue of its feedback and the command that became the event", () => {
    expect(momentOf(chunks, { event: 5, until: null }).feedback?.issue).toBe(2);
    expect(momentOf(chunks, { event: 6, until: null }).command?.values).toEqual([0.2]);
    expect(momentOf(chunks, { event: 5, until: null }).command).toBeNull();
  });

  it("within an event has only what had arrived by then", () => {
    const moment = momentOf(chunks, { event: 5, until: 22 });
    expect(moment.feedback?.issue).toBe(1);
    expect(moment.pictures.get("/camera/front")?.record.event).toBe(4);
    expect(eventAtTime(chunks, 49)).toBe(5);
    expect(eventAtTime(chunks, 19)).toBeNull();
  });

  it("shows no picture without a keyframe", () => {
    expect(momentOf(chunks.slice(1), { event: 6, until: null }).pictures.size).toBe(0);
  });
});

it("a picture that builds on one that was left out is not shown, and one from the next keyframe on is", () => {
  const lost = { topic: "/lockstep/degraded", event: 3, arrived: 3, payload: '{"lost": 1}' };
  const parts = [picture(1, 1, true), picture(2, 2, false), lost, picture(4, 4, false), picture(5, 5, true)];
  const chunk = parseChunkBody(0, bodyOf(parts));
  const stamp = (event: number) =>
    momentOf([chunk], { event, until: null }).pictures.get("/camera/front")?.record.event;
  expect([1, 2, 3, 4, 5].map(stamp)).toEqual([1, 2, 2, undefined, 5]);
});

it("a chunk that is cut off is refused", () => {
  const whole = bodyOf([feedback(5, 1, 20)]);
  for (const length of [2, 10, whole.byteLength - 1])
    expect(() => parseChunkBody(0, whole.slice(0, length))).toThrow(ChunkBroken);
});

function index(from: number): ReplayIndex {
  const found = parseIndex({
    version: 1,
    epoch: "e",
    first_event: 1,
    last_event: 30,
    chunks: [
      [0, 1, 10, 0, 9],
      [1, 10, 10, 10, 19],
      [2, 9, 30, 20, 29],
    ].slice(from),
    events: [
      [1, 0, 0],
      [11, 20, 2],
    ].slice(from === 0 ? 0 : 1),
    keyframes: {
      "/camera/front": [
        [1, 0, 0],
        [10, 12, 1],
        [20, 25, 2],
      ].filter((each) => (each[2] ?? 0) >= from),
    },
    marks: [],
  });
  if (found === null) throw new Error("the index cannot be read");
  return found;
}

describe("an index", () => {
  it("knows the chunks that can hold an event, also where the robot was idle for long", () => {
    expect(chunksOf(index(0), 10)).toEqual({ first: 0, last: 2 });
    expect(chunksOf(index(0), 5)).toEqual({ first: 0, last: 0 });
    expect(chunksOf(index(0), 30)).toEqual({ first: 2, last: 2 });
  });

  it("finds the keyframe before an event and a time", () => {
    expect(keyframeBefore(index(0), "/camera/front", 19, Infinity)?.[2]).toBe(1);
    expect(keyframeBefore(index(0), "/camera/front", 19, 11)?.[2]).toBe(0);
    expect(keyframeBefore(index(0), "/camera/back", 19, Infinity)).toBeNull();
  });

  it("that grew is the same as the whole", () => {
    expect(grownIndex(index(0), index(2), 2)).toEqual(index(0));
  });

  it("of another version is none", () => {
    expect(parseIndex({ version: 2 })).toBeNull();
  });
});

describe("a damaged chunk", () => {
  const place = { event: 4, until: null };
  const first = parseChunkBody(0, bodyOf([picture(1, 1, true), feedback(1, 1, 1)]));
  const last = parseChunkBody(2, bodyOf([picture(4, 4, false), feedback(4, 1, 4)]));

  it("takes with it the pictures that build on it, and nothing that says its own event", () => {
    const moment = momentOf([first, brokenChunk(1), last], place);
    expect(moment.damaged).toBe(true);
    expect(moment.pictures.size).toBe(0);
    expect(moment.feedback?.event).toBe(4);
  });

  it("does not matter before the keyframe", () => {
    const key = parseChunkBody(2, bodyOf([picture(4, 4, true), feedback(4, 1, 4)]));
    const moment = momentOf([first, brokenChunk(1), key], place);
    expect(moment.pictures.get("/camera/front")?.record.event).toBe(4);
  });
});

describe("sound whose codec changes", () => {
  const packets = (formats: readonly string[]): ReplayRecord[] => {
    const parts = formats.map((format, at) => ({
      topic: "/microphone/ear",
      event: 1,
      arrived: at,
      format,
      payload: `${at}`,
    }));
    return [...(parseChunkBody(0, bodyOf(parts)).media.get("/microphone/ear") ?? [])];
  };
  const runsOf = (before: readonly string[], formats: readonly string[]): string[][] =>
    soundRuns({ before: packets(before), packets: packets(formats) }).map((run) => [
      run.before.map((each) => `${each.format} ${each.arrived}`).join(", "),
      run.packets.map((each) => `${each.format} ${each.arrived}`).join(", "),
    ]);

  it("is decoded in parts of one codec each", () => {
    expect(runsOf([], ["opus", "opus", "g711-ulaw", "opus"])).toEqual([
      ["", "opus 0, opus 1"],
      ["", "g711-ulaw 2"],
      ["", "opus 3"],
    ]);
    expect(runsOf(["opus"], [])).toEqual([]);
  });

  it("has before it what its own decoder has to have heard, and nothing of another codec", () => {
    expect(runsOf(["opus", "g711-ulaw", "opus", "opus"], ["opus"])).toEqual([["opus 2, opus 3", "opus 0"]]);
    expect(runsOf(["opus", "opus"], ["g711-ulaw", "opus"])).toEqual([
      ["", "g711-ulaw 0"],
      ["", "opus 1"],
    ]);
  });
});

describe("what somebody else's file says", () => {
  const hostile = `a\u202Eb\n${"x".repeat(100_000)}`;
  const shown = `a b ${"x".repeat(196)}`;

  it("is short, and turns and ends no line", () => {
    const index = parseIndex({ version: 1, marks: [{ event: 1, time: 1, kind: "note", text: hostile }] });
    expect(index?.marks[0]?.text).toBe(shown);
    const seat = {
      topic: "/lockstep/seat",
      event: 1,
      arrived: 1,
      payload: JSON.stringify({ name: hostile }),
    };
    expect(parseChunkBody(0, bodyOf([seat])).seats).toEqual([{ arrived: 1, name: shown }]);
  });

  it("has no more numbers and names than a robot has", () => {
    const payload = JSON.stringify({
      event: 1,
      ranges: Array.from({ length: 100_000 }, () => 1),
      faults: Array.from({ length: 100_000 }, () => hostile.slice(0, 10)),
    });
    const record = { topic: "/lockstep/feedback", event: 1, arrived: 1, payload };
    const [feedback] = parseChunkBody(0, bodyOf([record])).feedback;
    expect([feedback?.ranges.length, feedback?.faults.length]).toEqual([4096, 512]);
  });
});

describe("the feedback of a picture", () => {
  const loaded = (parts: readonly Part[]): ReturnType<typeof momentOf> =>
    momentOf([parseChunkBody(0, bodyOf(parts))], { event: 5, until: null });

  it("is of exactly its event, as it was when the picture came", () => {
    const parts = [feedback(4, 1, 5), feedback(4, 2, 9), picture(4, 10, true), feedback(4, 3, 12)];
    const moment = loaded([...parts, feedback(5, 1, 20)]);
    expect(moment.feedback?.event).toBe(5);
    expect(moment.pictures.get("/camera/front")?.feedback).toMatchObject({ event: 4, issue: 2 });
  });

  it("is the first of its event where the picture overtook it", () => {
    const moment = loaded([picture(5, 10, true), feedback(5, 1, 12), feedback(5, 2, 14)]);
    expect(moment.pictures.get("/camera/front")?.feedback).toMatchObject({ event: 5, issue: 1 });
  });

  it("is none where that event's is not loaded", () => {
    const moment = loaded([picture(4, 10, true), feedback(5, 1, 12)]);
    expect(moment.pictures.get("/camera/front")).not.toHaveProperty("feedback");
  });
});
