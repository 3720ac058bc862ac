/** Header extensions that this page asks for (docs/architecture.md, "Carriers"). */
const CAPTURE_TIME_URI = "http://www.webrtc.org/experiments/rtp-hdrext/abs-capture-time";
const PLAYOUT_DELAY_URI = "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay";

interface HeaderExtension {
  uri: string;
  direction: RTCRtpTransceiverDirection;
}

/** WebRTC Extensions 4.2; not in TypeScript's library, and not in every browser. */
interface NegotiableTransceiver {
  getHeaderExtensionsToNegotiate(): HeaderExtension[];
  setHeaderExtensionsToNegotiate(extensions: HeaderExtension[]): void;
}

/**
 * Offers abs-capture-time, and playout-delay for video: sound needs its buffer.
 * Says whether the stamp can travel in capture times.
 */
export function askForCaptureTime(transceiver: RTCRtpTransceiver, kind: "audio" | "video"): boolean {
  if (!isNegotiable(transceiver)) return false;
  const wanted = kind === "video" ? [CAPTURE_TIME_URI, PLAYOUT_DELAY_URI] : [CAPTURE_TIME_URI];
  const extensions = transceiver.getHeaderExtensionsToNegotiate();
  for (const extension of extensions) if (wanted.includes(extension.uri)) extension.direction = "sendrecv";
  transceiver.setHeaderExtensionsToNegotiate(extensions);
  return extensions.some((extension) => extension.uri === CAPTURE_TIME_URI);
}

function isNegotiable(transceiver: unknown): transceiver is NegotiableTransceiver {
  return (
    typeof RTCRtpTransceiver !== "undefined" &&
    "setHeaderExtensionsToNegotiate" in RTCRtpTransceiver.prototype &&
    transceiver instanceof RTCRtpTransceiver
  );
}
