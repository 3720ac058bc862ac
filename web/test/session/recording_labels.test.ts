import { expect, it } from "vitest";
import { elapsed, recordingLabels } from "../../src/session/recording_labels";
import type { RecordingState } from "../../src/protocol/wire";

const RUNNING: RecordingState = {
  type: "recording",
  state: "recording",
  id: "a",
  recording: "a",
  name: "",
  by: "Ada",
  since: 0,
  bytes: 2_500_000,
  lost: 0,
  detail: "",
};

it("counts minutes and seconds, from an hour on with hours", () => {
  expect([elapsed(-3), elapsed(125.9), elapsed(3725)]).toEqual(["0:00", "2:05", "1:02:05"]);
});

it("says of a running recording how long, how large and by whom", () => {
  const words = recordingLabels(RUNNING, 65, true);
  expect(words.text).toBe("Rec 1:05");
  expect(words.title).toBe("This session is recorded, started by Ada: 2.5 MB. Press to stop");
  expect(words.tone).toBe("on");
});

it("says why a recording failed", () => {
  const words = recordingLabels({ ...RUNNING, state: "failed", detail: "No space left on device" }, 0, true);
  expect(words.tone).toBe("bad");
  expect(words.title).toContain("No space left");
});

it("shows that records are missing", () => {
  expect(recordingLabels({ ...RUNNING, lost: 3 }, 1, false).tone).toBe("bad");
});

it("tells who may start a recording how", () => {
  expect(recordingLabels(null, 0, false).title).toBe("");
  expect(recordingLabels(null, 0, true).title).toBe("Record this session");
});
