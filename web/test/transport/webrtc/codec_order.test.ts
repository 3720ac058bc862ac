import { expect, test } from "vitest";
import { offeredCodecs, type OfferableCodec } from "../../../src/transport/webrtc/codec_order";

const VP8 = { mimeType: "video/VP8" };
const VP9 = { mimeType: "video/VP9", sdpFmtpLine: "profile-id=0" };
const RTX = { mimeType: "video/rtx" };
const RED = { mimeType: "video/red" };

function h264(profile: string, mode: number): OfferableCodec {
  const format = `level-asymmetry-allowed=1;packetization-mode=${mode};profile-level-id=${profile}`;
  return { mimeType: "video/H264", sdpFmtpLine: format };
}

test("H.264 of the baseline comes first, its other profiles next, then VP8, and nothing that no console sends", () => {
  const [high, single, plain] = [h264("64001f", 1), h264("42001f", 0), h264("42e01f", 1)];
  const found = offeredCodecs([VP8, RTX, VP9, high, single, plain, RED]);
  expect(found).toEqual([plain, high, VP8, RTX]);
});

test("without the profile of H.264 that a console encodes VP8 comes first", () => {
  expect(offeredCodecs([VP9, RTX, VP8])).toEqual([VP8, RTX]);
  expect(offeredCodecs([h264("64001f", 1), VP8, h264("42e01f", 0)])).toEqual([VP8, h264("64001f", 1)]);
});

test("a browser with neither keeps its own order", () => {
  expect(offeredCodecs([VP9, RTX])).toBeNull();
});
