import { h264First } from "../core/codec_order";

/**
 * Offers H.264 before all other codecs (docs/media.md, "Codecs"): it takes the console and this computer about half the
 * time that VP8 takes, and what is recorded is then what is encoded anyway.
 */
export function preferH264(transceiver: RTCRtpTransceiver): void {
  const codecs = h264First(RTCRtpReceiver.getCapabilities("video")?.codecs ?? []);
  if (codecs === null) return;
  try {
    transceiver.setCodecPreferences(codecs);
  } catch {
    return; // the order is a wish: without it the browser's own holds
  }
}
