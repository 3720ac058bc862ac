import { expect, test } from "vitest";
import { SourceStamps, type CapturedSource } from "../../../src/transport/webrtc/source_stamps";

function told(sources: readonly CapturedSource[]): {
  stamps: SourceStamps;
  receiver: FakeReceiver;
  reports: number[];
} {
  const receiver = new FakeReceiver(sources);
  const reports: number[] = [];
  const stamps = new SourceStamps(receiver, () => reports.push(receiver.asked));
  return { stamps, receiver, reports };
}

class FakeReceiver {
  asked = 0;
  constructor(public sources: readonly CapturedSource[]) {}
  getSynchronizationSources(): readonly CapturedSource[] {
    this.asked += 1;
    return this.sources;
  }
}

test("a picture has the event and the capture time that its source tells", () => {
  const { stamps } = told([
    { rtpTimestamp: 900, senderCaptureTimeOffset: 7000, captureTimestamp: 2_208_988_800_250 },
  ]);
  expect(stamps.find(900)).toEqual({ stamp: 7, capturedMs: 250 });
});

test("what the source tells of another picture is no picture's own event", () => {
  const { stamps, reports } = told([{ rtpTimestamp: 901, senderCaptureTimeOffset: 8000 }]);
  expect(stamps.find(900)).toBeUndefined();
  expect(stamps.find(902)).toBeUndefined();
  expect(reports).toEqual([]);
});

test("before the first frame nothing is known", () => {
  expect(told([]).stamps.find(900)).toBeUndefined();
});

test("an event that was read stays known when newer frames have come", () => {
  const { stamps, receiver } = told([{ rtpTimestamp: 900, senderCaptureTimeOffset: 7000 }]);
  stamps.find(900);
  receiver.sources = [{ rtpTimestamp: 901, senderCaptureTimeOffset: 9000 }];
  expect(stamps.find(900)?.stamp).toBe(7);
  expect(stamps.find(901)?.stamp).toBe(9);
});

test("an offset that is no event is no stamp", () => {
  const { stamps } = told([{ rtpTimestamp: 900, senderCaptureTimeOffset: 7000.4 * 1.001 }]);
  expect(stamps.find(900)).toEqual({ stamp: null, capturedMs: null });
});

test("a browser that tells no events is reported once", () => {
  const { stamps, receiver, reports } = told([]);
  for (let picture = 1; picture <= 100; picture++) {
    receiver.sources = [{ rtpTimestamp: picture }];
    stamps.find(picture);
    stamps.find(picture);
  }
  expect(reports).toEqual([30]);
});

test("a browser that has told an event is never reported", () => {
  const { stamps, receiver, reports } = told([{ rtpTimestamp: 1, senderCaptureTimeOffset: 1000 }]);
  stamps.find(1);
  for (let picture = 2; picture <= 100; picture++) {
    receiver.sources = [{ rtpTimestamp: picture }];
    stamps.find(picture);
  }
  expect(reports).toEqual([]);
});
