import { describe, expect, test } from "vitest";

import { allOf, filtered, isFiltering, NO_FILTER, valuesOf } from "../../src/episodes/episode_filter";
import { parseEpisodeList, parseRecording, type RecordingEpisodes } from "../../src/episodes/episode_list";
import { qualityWords, summaryWords, tagsOf } from "../../src/episodes/episode_words";

function episode(id: string, change: Record<string, unknown> = {}): Record<string, unknown> {
  return {
    id,
    number: 1,
    state: "kept",
    editable: true,
    restorable: false,
    task: "push",
    outcome: "success",
    first_event: 10,
    last_event: 20,
    events: 10,
    first_bound: 10,
    last_bound: 20,
    started: 1_000_000,
    ended: 3_000_000,
    why: "",
    drivers: ["Ada"],
    problems: [],
    marks: 0,
    pause: 0,
    made_of: [],
    merges_with: "",
    ...change,
  };
}

function recording(id: string, ...episodes: Record<string, unknown>[]): RecordingEpisodes {
  const info = { id, name: id, robot: "arm", started: 0, running: false };
  const found = parseRecording({ info, cameras: ["front"], revision: 0, changes: [], episodes, trouble: "" });
  if (found === null) throw new Error("no recording");
  return found;
}

const ALL = allOf([
  recording(
    "one",
    episode("a"),
    episode("b", { state: "discarded", outcome: "", started: 5_000_000, ended: 5_500_000, drivers: ["Bo"] }),
    episode("c", {
      task: "wipe",
      outcome: "failure",
      problems: ["camera_missing front"],
      started: 9_000_000,
      ended: 9_900_000,
    }),
  ),
  recording("two", episode("a", { started: 20_000_000, ended: 29_000_000, outcome: "", pause: 3_200_000 })),
  recording("three", episode("d", { state: "cut", why: "link_down", outcome: "", started: 2_000_000 })),
]);

const ids = (filter: object): string[] =>
  filtered(ALL, { ...NO_FILTER, ...filter }).map((each) => `${each.recording.id}/${each.episode.id}`);

describe("the filter of episodes", () => {
  test.each([
    [{}, ["two/a", "one/c", "one/b", "three/d", "one/a"]],
    [{ state: "kept" }, ["two/a", "one/c", "one/a"]],
    [{ state: "lost" }, ["three/d"]],
    [{ outcome: "failure" }, ["one/c"]],
    [{ outcome: "unsaid" }, ["two/a", "one/b"]],
    [{ quality: "problems" }, ["two/a", "one/c", "three/d"]],
    [{ quality: "good" }, ["one/b", "one/a"]],
    [{ task: "wipe" }, ["one/c"]],
    [{ driver: "Bo" }, ["one/b"]],
    [{ recording: "two" }, ["two/a"]],
    [{ words: "PUSH ada" }, ["two/a", "three/d", "one/a"]],
    [{ words: "no pictures of front" }, ["one/c"]],
    [{ sorting: "longest" }, ["two/a", "one/a", "three/d", "one/c", "one/b"]],
    [{ sorting: "oldest" }, ["one/a", "three/d", "one/b", "one/c", "two/a"]],
    [{ sorting: "worst", state: "kept" }, ["one/c", "two/a", "one/a"]],
  ])("%o", (filter, expected) => {
    expect(ids(filter)).toEqual(expected);
  });

  test("an order alone filters nothing", () => {
    expect(isFiltering({ ...NO_FILTER, sorting: "task" })).toBe(false);
    expect(isFiltering({ ...NO_FILTER, words: "x" })).toBe(true);
  });

  test("values are offered once, the most frequent first", () => {
    expect(valuesOf(ALL, (each) => [each.task])).toEqual(["push", "wipe"]);
  });
});

describe("the words of an episode", () => {
  test("say what was wrong, and what became of it", () => {
    const words = ALL.map(({ episode: each }) => qualityWords(each));
    expect(words).toEqual([
      "No problems",
      "No problems",
      "no pictures of front",
      "pause of 3.2 s",
      "the robot link was lost",
    ]);
    expect(
      ALL.map(({ episode: each }) =>
        tagsOf(each)
          .map((tag) => tag.text)
          .join(),
      ),
    ).toEqual(["Success", "Discarded", "Failure", "", "Lost"]);
    expect(summaryWords(ALL.slice(0, 1), 5)).toBe("1 of 5 episodes · 1 kept, 0:02");
  });
});

describe("an answer that is not what it should be", () => {
  test.each([null, 3, {}, { version: "x" }, { version: 1, recordings: [] }])("is none: %o", (value) => {
    expect(parseEpisodeList(value)).toBeNull();
  });

  test("loses what cannot be read, and keeps the rest", () => {
    const broken = [episode("a", { state: "other" }), episode("b", { first_event: 0 }), 3, episode("c")];
    const info = { id: "one" };
    const found = parseEpisodeList({
      version: "v",
      recordings: [{ info, episodes: broken }, null, { info }],
    });
    expect(found?.recordings.map((each) => each.episodes.map(({ id }) => id))).toEqual([["c"]]);
    expect(found?.recordings[0]?.cameras).toEqual([]);
  });
});
