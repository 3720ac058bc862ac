import { describe, expect, it } from "vitest";
import type { ReceiverStamps } from "../../../src/transport/encoded_transform/stamp_reader";
import { receivedSection } from "../../../src/transport/webrtc/media_section";

describe("a section that is received", () => {
  it("keeps its track where the page plays the packets itself: the browser plays it when the page cannot", () => {
    const track = {} as MediaStreamTrack;
    const stamps = { packets: true } as ReceiverStamps;
    expect(receivedSection("audio", { track } as RTCRtpReceiver, stamps).track).toBe(track);
  });
});
