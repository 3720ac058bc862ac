import { expect, test } from "vitest";
import { h264First, type OfferableCodec } from "../../src/core/codec_order";

const VP8 = { mimeType: "video/VP8" };
const VP9 = { mimeType: "video/VP9", sdpFmtpLine: "profile-id=0" };
const RTX = { mimeType: "video/rtx" };
const RED = { mimeType: "video/red" };

function h264(profile: string, mode: number): OfferableCodec {
  const format = `level-asymmetry-allowed=1;packetization-mode=${mode};profile-level-id=${profile}`;
  return { mimeType: "video/H264", sdpFmtpLine: format };
}

test("H.264 of the baseline comes first, its other profiles next, and nothing is left out", () => {
  const [high, single, plain] = [h264("64001f", 1), h264("42001f", 0), h264("42e01f", 1)];
  const found = h264First([VP8, RTX, VP9, high, single, plain, RED]);
  expect(found).toEqual([plain, high, single, VP8, VP9, RTX, RED]);
});

test("without H.264 that a console encodes the browser's own order stays", () => {
  expect(h264First([VP8, RTX, VP9])).toBeNull();
  expect(h264First([VP8, h264("64001f", 1), h264("42e01f", 0)])).toBeNull();
});
