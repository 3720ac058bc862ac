import { describe, expect, test } from "vitest";

import { parseRecording, type Episode } from "../../src/episodes/episode_list";
import {
  eventAt,
  eventFrom,
  isTrimmed,
  maySplit,
  middleOf,
  moved,
  spanOf,
} from "../../src/episodes/episode_span";
import { MAX_EVENT } from "../../src/gate/serial";

function episodeOf(
  first: number,
  last: number,
  firstBound: number,
  lastBound: number,
  events: number,
): Episode {
  const found = parseRecording({
    info: { id: "r" },
    episodes: [
      {
        id: "a",
        state: "kept",
        outcome: "",
        first_event: first,
        last_event: last,
        first_bound: firstBound,
        last_bound: lastBound,
        events,
      },
    ],
  })?.episodes[0];
  if (found === undefined) throw new Error("no episode");
  return found;
}

describe("the handles of an editor", () => {
  const episode = episodeOf(12, 18, 10, 20, 6);
  const span = spanOf(episode);

  test("begin where the episode does, within its bounds", () => {
    expect(span).toEqual({ length: 10, first: 2, last: 8, cursor: 5 });
    expect(["first", "cursor", "last"].map((each) => eventAt(episode, span, each as "first"))).toEqual([
      12, 15, 18,
    ]);
    expect(isTrimmed(span, episode)).toBe(false);
  });

  test("leave at least one event, stay within the bounds, and keep the cursor between", () => {
    expect(moved(span, "first", -5)).toMatchObject({ first: 0, last: 8 });
    expect(moved(span, "first", 30)).toMatchObject({ first: 7, last: 8, cursor: 7 });
    expect(moved(span, "last", -5)).toMatchObject({ first: 2, last: 3, cursor: 3 });
    expect(moved(span, "last", 99)).toMatchObject({ last: 10 });
    expect(moved(span, "cursor", 99)).toMatchObject({ cursor: 8 });
    expect(isTrimmed(moved(span, "first", 3), episode)).toBe(true);
  });

  test("a split is between the ends", () => {
    expect(maySplit(span)).toBe(true);
    expect(maySplit(moved(span, "cursor", 8))).toBe(false);
    expect(maySplit(moved(span, "cursor", 2))).toBe(false);
  });

  test("go across the wrap of the event reference", () => {
    const wraps = episodeOf(MAX_EVENT - 2, 4, MAX_EVENT - 2, 4, 7);
    expect(middleOf(wraps)).toBe(1);
    expect(eventFrom(MAX_EVENT, 1)).toBe(1);
    expect(eventFrom(1, -1)).toBe(MAX_EVENT);
  });
});
