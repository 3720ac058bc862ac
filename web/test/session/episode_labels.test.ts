import { expect, it } from "vitest";
import type { EpisodeState, RecordingState } from "../../src/protocol/wire";
import {
  episodeLabels,
  leftEpisode,
  problemWords,
  spokenProblems,
  withLeftEpisode,
} from "../../src/session/episode_labels";

const IDLE: EpisodeState = {
  type: "episode",
  phase: "idle",
  episode: "",
  number: 0,
  task: "",
  by: "",
  seconds_left: 0,
  since: 0,
  first_event: 0,
  kept: 0,
  discarded: 0,
  cut: 0,
  last: "",
  lost: "",
  last_episode: "",
  reads_recordings: false,
  reset_action: "",
  problems: [],
};
const RECORDING: RecordingState = {
  type: "recording",
  state: "recording",
  id: "a",
  recording: "a",
  name: "",
  by: "",
  since: 0,
  bytes: 0,
  lost: 0,
  detail: "",
};

it("counts down, and says how long the open one runs", () => {
  const counting = episodeLabels({ ...IDLE, phase: "countdown", seconds_left: 3 }, RECORDING, 0.5, 0);
  expect(counting).toMatchObject({ tone: "wait", text: "Begins in 3" });
  for (const phase of ["countdown", "resetting"] as const)
    expect(episodeLabels({ ...IDLE, phase, seconds_left: 9 }, RECORDING, 3.5, 0)).toMatchObject({
      tone: "bad",
      text: "The console does not answer",
    });
  const keeping = episodeLabels({ ...IDLE, phase: "keeping", number: 7 }, RECORDING, 3.5, 0);
  expect(keeping.text).toBe("Take 7: the console does not answer");
  const open = episodeLabels({ ...IDLE, phase: "open", number: 7 }, RECORDING, 0, 65);
  expect(open).toMatchObject({ tone: "on", text: "Take 7", time: "1:05" });
});

it("turns red as soon as something spoils the episode, and names it", () => {
  const problems = [
    { kind: "camera_missing", stream: "front", text: "front: no picture for 2 s" },
    { kind: "disk_low", stream: "", text: "the disk is almost full" },
  ] as const;
  expect(episodeLabels({ ...IDLE, phase: "open", problems }, RECORDING, 0, 1).tone).toBe("bad");
  expect(problemWords(problems)).toBe("front: no picture for 2 s · the disk is almost full");
});

it("counts what was kept, discarded and lost", () => {
  expect(episodeLabels({ ...IDLE, kept: 3 }, RECORDING, 0, 0).count).toBe("3 kept");
  expect(episodeLabels({ ...IDLE, kept: 3, discarded: 2, cut: 1 }, RECORDING, 0, 0).count).toBe(
    "3 kept · 2 discarded · 1 lost",
  );
});

it("says why no episode can begin", () => {
  expect(episodeLabels(IDLE, null, 0, 0).text).toBe("Record first");
  const failed: RecordingState = { ...RECORDING, state: "failed", detail: "only 3 MB are free on the disk" };
  expect(episodeLabels(IDLE, failed, 0, 0)).toMatchObject({
    tone: "bad",
    text: "Not recording: only 3 MB are free on the disk",
  });
});

it("names the worst problem first, and aloud without figures that change", () => {
  const problems = [
    { kind: "camera_slow", stream: "front", text: "front: 3 pictures a second instead of 15" },
    { kind: "no_events", stream: "", text: "nobody has driven for 12 s" },
    { kind: "disk_low", stream: "", text: "the disk is almost full: 3 MB until the recording ends" },
    { kind: "camera_missing", stream: "wrist", text: "wrist: no picture for 2 s" },
  ] as const;
  expect(problemWords(problems)).toBe(
    "wrist: no picture for 2 s · the disk is almost full: 3 MB until the recording ends · " +
      "front: 3 pictures a second instead of 15 · nobody has driven for 12 s",
  );
  expect(spokenProblems(problems)).toBe(
    "wrist: no picture, the disk is almost full, front: too few pictures, nobody drives",
  );
});

it("says that an episode is lost also where the recording ended with it", () => {
  const last = "episode 2 is lost: the recording failed";
  const state: EpisodeState = { ...IDLE, number: 2, last, lost: "recording_failed" };
  const failed: RecordingState = { ...RECORDING, state: "failed", detail: "no space left" };
  expect(episodeLabels(state, failed, 0, 0)).toMatchObject({
    tone: "bad",
    text: "Episode 2 is lost: no space left",
  });
  expect(episodeLabels(state, { ...RECORDING, state: "off" }, 0, 0)).toMatchObject({
    tone: "bad",
    text: "Episode 2 is lost: the recording failed · Record first",
  });
  expect(
    episodeLabels(
      { ...state, last: "episode 2 is lost: the robot link was lost", lost: "link_down" },
      failed,
      0,
      0,
    ),
  ).toMatchObject({ tone: "bad", text: "Episode 2 is lost: the robot link was lost" });
  expect(episodeLabels({ ...IDLE, last: "episode 1 is kept" }, null, 0, 0).text).toBe("Record first");
});

it("says that an episode is lost with the console", () => {
  const left = leftEpisode({ ...IDLE, phase: "open", episode: "a", number: 3 });
  expect(left).toEqual({ episode: "a", number: 3 });
  expect(leftEpisode(IDLE)).toBeNull();
  expect(leftEpisode(null)).toBeNull();
  expect(withLeftEpisode(IDLE, left)).toMatchObject({
    last: "episode 3: the console ended, the list of episodes says whether it is kept",
    lost: "console_ended",
  });
  const reads = withLeftEpisode({ ...IDLE, reads_recordings: true }, left);
  expect(reads).toMatchObject({ last: "episode 3: the console reads its recordings", lost: "" });
  const goesOn = { ...IDLE, phase: "open", episode: "a", number: 3 } as const;
  expect(withLeftEpisode(goesOn, left)).toEqual(goesOn);
  const kept = { ...IDLE, last: "episode 3 is kept", last_episode: "a" };
  expect(withLeftEpisode(kept, left)).toEqual(kept);
  const other = { ...IDLE, last: "episode 2 is kept", last_episode: "b" };
  expect(withLeftEpisode(other, left).lost).toBe("console_ended");
  expect(withLeftEpisode(IDLE, null)).toEqual(IDLE);
});

it("says that the console does not answer as soon as nothing is heard of the open episode", () => {
  const open = { ...IDLE, phase: "open", number: 7 } as const;
  expect(episodeLabels(open, RECORDING, 2.5, 65).text).toBe("Take 7");
  const silent = episodeLabels(open, RECORDING, 3.5, 65);
  expect(silent).toMatchObject({ tone: "bad", text: "Take 7: the console does not answer", time: "" });
  expect(episodeLabels(IDLE, RECORDING, 60, 0).text).toBe("No episode yet");
});
