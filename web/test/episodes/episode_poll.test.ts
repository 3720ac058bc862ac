import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";

import type { EpisodeList, RecordingEpisodes } from "../../src/episodes/episode_list";
import { EpisodePoll } from "../../src/episodes/episode_poll";
import { PictureLoader } from "../../src/episodes/picture_loader";
import { ConsoleError } from "../../src/transport/signalling/console_api";

const recording = (id: string, revision: number): RecordingEpisodes => ({
  id,
  name: id,
  robot: "",
  started: 0,
  running: false,
  cameras: [],
  revision,
  changes: [],
  episodes: [],
  trouble: "",
});

const answer = (change: Partial<EpisodeList>): EpisodeList => ({
  version: "1",
  unchanged: false,
  recordings: [],
  older: 0,
  pending: 0,
  unreadable: 0,
  ...change,
});

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

describe("the list that the page follows", () => {
  test("asks again soon while files are read, keeps what it knows through trouble, and says so", async () => {
    const answers: (EpisodeList | ConsoleError)[] = [
      answer({ recordings: [recording("a", 0)], pending: 3 }),
      answer({ version: "2", recordings: [recording("a", 0), recording("b", 0)] }),
      new ConsoleError(0, "console_unreachable", "", null),
      answer({ version: "2", unchanged: true }),
    ];
    const asked: string[] = [];
    const poll = new EpisodePoll(
      {
        list: (known) => {
          asked.push(known);
          const next = answers.shift();
          return next instanceof ConsoleError
            ? Promise.reject(next)
            : Promise.resolve(next ?? answer({ unchanged: true }));
        },
      },
      () => undefined,
      () => true,
    );
    const names = (): string[] => (poll.state.recordings ?? []).map((each) => each.id);
    poll.start();
    await vi.advanceTimersByTimeAsync(0);
    expect([names(), poll.state.pending]).toEqual([["a"], 3]);
    await vi.advanceTimersByTimeAsync(300);
    expect([names(), poll.state.pending]).toEqual([["a", "b"], 0]);
    await vi.advanceTimersByTimeAsync(4000);
    expect([names(), poll.state.trouble]).toEqual([["a", "b"], expect.any(ConsoleError)]);
    await vi.advanceTimersByTimeAsync(3000);
    expect([names(), poll.state.trouble]).toEqual([["a", "b"], null]);
    expect(asked).toEqual(["", "1", "2", "2"]);
    poll.close();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(asked).toHaveLength(4);
  });

  test("shows a change at once, and no older answer in its place", async () => {
    const answers = [
      answer({ recordings: [recording("a", 0)] }),
      answer({ version: "2", recordings: [recording("a", 0)] }),
      answer({ version: "3", recordings: [recording("a", 2)] }),
    ];
    const poll = new EpisodePoll(
      { list: () => Promise.resolve(answers.shift() ?? answer({ unchanged: true })) },
      () => undefined,
      () => true,
    );
    const revision = (): number | undefined => poll.state.recordings?.[0]?.revision;
    poll.start();
    await vi.advanceTimersByTimeAsync(0);
    poll.put(recording("a", 1));
    expect(revision()).toBe(1);
    await vi.advanceTimersByTimeAsync(4000);
    expect(revision()).toBe(1);
    await vi.advanceTimersByTimeAsync(4000);
    expect(revision()).toBe(2);
    poll.close();
  });
});

describe("the loader of pictures", () => {
  const wanted = (event: number) => ({ recording: "a", camera: "front", event, width: 160 });

  test("asks for a few at a time, for the newest wish first, and not for what nobody waits for", async () => {
    const asked: number[] = [];
    const open: (() => void)[] = [];
    const loader = new PictureLoader(({ event }) => {
      asked.push(event);
      return new Promise((resolve) => open.push(() => resolve(new ArrayBuffer(1))));
    });
    const gone = new AbortController();
    const found = [1, 2, 3, 4, 5, 6].map((event) =>
      loader.load(wanted(event), event === 5 ? gone.signal : new AbortController().signal),
    );
    expect(asked).toEqual([1, 2, 3]);
    gone.abort();
    for (let each = 0; each < 5; each++) {
      open[each]?.();
      await vi.advanceTimersByTimeAsync(0);
    }
    expect(asked).toEqual([1, 2, 3, 6, 4]);
    const urls = await Promise.all(found);
    expect(urls.map((url) => url === null)).toEqual([false, false, false, false, true, false]);
    expect(loader.known(wanted(1))).toBe(urls[0]);
    loader.close();
    expect(loader.known(wanted(1))).toBeNull();
  });

  test("waits while the console has too much to do, and gives up for good reasons at once", async () => {
    let tries = 0;
    const busy = new PictureLoader(() => {
      tries += 1;
      return tries < 3
        ? Promise.reject(new ConsoleError(429, "too_many_requests", "", null))
        : Promise.resolve(new ArrayBuffer(1));
    });
    const found = busy.load(wanted(1), new AbortController().signal);
    await vi.advanceTimersByTimeAsync(10_000);
    expect(await found).not.toBeNull();
    expect(tries).toBe(3);
    busy.close();
    const none = new PictureLoader(() => Promise.reject(new ConsoleError(404, "not_found", "", null)));
    expect(await none.load(wanted(1), new AbortController().signal)).toBeNull();
    none.close();
  });
});
