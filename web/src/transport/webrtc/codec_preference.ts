import { offeredCodecs } from "./codec_order";

/**
 * Offers H.264 before VP8 and nothing else (docs/media.md, "Codecs"): H.264 takes the console and this computer about
 * half the time that VP8 takes, and what is recorded is then what is encoded anyway.
 */
export function preferCodecs(transceiver: RTCRtpTransceiver): void {
  const codecs = offeredCodecs(RTCRtpReceiver.getCapabilities("video")?.codecs ?? []);
  if (codecs === null) return;
  try {
    transceiver.setCodecPreferences(codecs);
  } catch {
    return; // the order is a wish: without it the browser's own holds
  }
}
