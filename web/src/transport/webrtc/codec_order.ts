/** What is known of a codec before it is offered: an entry of RTCRtpReceiver.getCapabilities. */
export interface OfferableCodec {
  readonly mimeType: string; // "video/H264"
  readonly sdpFmtpLine?: string; // "level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f"
}

const H264 = "video/h264";
const VP8 = "video/vp8";
const REPEATS = "video/rtx"; // RFC 4588, of either
const BASELINE = "42"; // profile_idc 66, which every console encodes
const FRAGMENTS = "packetization-mode=1"; // of which a picture may be larger than a packet

/**
 * What consoles and relays send, and nothing else, so that an offer fits one congestion window: H.264 first, the profile
 * that the console encodes before its larger ones, then VP8; VP8 first where that profile is missing. null: there is
 * none of them.
 */
export function offeredCodecs<T extends OfferableCodec>(codecs: readonly T[]): T[] | null {
  const h264 = codecs.filter(
    ({ mimeType, sdpFmtpLine }) => is(mimeType, H264) && sdpFmtpLine?.includes(FRAGMENTS),
  );
  const [plain, larger] = [h264.filter(isBaseline), h264.filter((codec) => !isBaseline(codec))];
  const vp8 = codecs.filter(({ mimeType }) => is(mimeType, VP8));
  const pictures = plain.length > 0 ? [...plain, ...larger, ...vp8] : [...vp8, ...larger];
  return pictures.length > 0
    ? [...pictures, ...codecs.filter(({ mimeType }) => is(mimeType, REPEATS))]
    : null;
}

function is(mimeType: string, name: string): boolean {
  return mimeType.toLowerCase() === name;
}

function isBaseline(codec: OfferableCodec): boolean {
  return codec.sdpFmtpLine?.includes(`profile-level-id=${BASELINE}`) ?? false;
}
