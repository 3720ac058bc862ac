/** What is known of a codec before it is offered: an entry of RTCRtpReceiver.getCapabilities. */
export interface OfferableCodec {
  readonly mimeType: string; // "video/H264"
  readonly sdpFmtpLine?: string; // "level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f"
}

const H264 = "video/h264";
const LATER = ["video/rtx", "video/red", "video/ulpfec", "video/flexfec-03"];
const BASELINE = "42"; // profile_idc 66, which every console encodes
const FRAGMENTS = "packetization-mode=1"; // of which a picture may be larger than a packet

/**
 * H.264 first, the profile that the console encodes before its larger ones; all others stay behind it as they were, so
 * that a console or a relay that has no H.264 answers as before. null: there is none to put first.
 */
export function h264First<T extends OfferableCodec>(codecs: readonly T[]): T[] | null {
  const rank = (codec: T): number => {
    const type = codec.mimeType.toLowerCase();
    if (LATER.includes(type)) return 3;
    if (type !== H264) return 2;
    return isBaseline(codec.sdpFmtpLine ?? "") ? 0 : 1;
  };
  if (!codecs.some((codec) => rank(codec) === 0)) return null;
  return codecs.toSorted((one, other) => rank(one) - rank(other));
}

function isBaseline(format: string): boolean {
  return format.includes(FRAGMENTS) && format.includes(`profile-level-id=${BASELINE}`);
}
