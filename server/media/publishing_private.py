"""The console as the offering side, towards a relay: sections that send one codec each, and their extensions.

Private parts of aiortc: `RTCRtpTransceiver._codecs` and `._preferred_codecs`, which createOffer makes the offer from.
"""

import re

from aiortc import RTCPeerConnection, RTCRtpSender, RTCRtpTransceiver
from aiortc.codecs import CODECS
from aiortc.rtcpeerconnection import filter_preferred_codecs
from aiortc.rtcrtpparameters import RTCRtpCodecCapability

from robot_bridge.protocol.carriers import PLAYOUT_DELAY_URI
from server.media.aiortc_private import keep_extensions
from server.media.header_extensions import MID_URI

__all__ = ["H264_PROFILE", "PLAYOUT_DELAY_ID", "ask_for_no_delay", "keep_answered_extensions", "offer_section"]

H264_PROFILE = "42e01f"  # constrained baseline, what every browser takes
PLAYOUT_DELAY_ID = 9  # aiortc's own ids begin at 1
EXTMAP = re.compile(r"a=extmap:(\d+)(?:/\w+)? (\S+)")


def offer_section(pc: RTCPeerConnection, kind: str, codec: str) -> RTCRtpTransceiver:
    """A section that sends `codec` and nothing else."""
    transceiver = pc.addTransceiver(kind, direction="sendonly")
    transceiver.setCodecPreferences([_capability(kind, codec)])
    # As createOffer will do: what is decided by the codec is decided before.
    transceiver._codecs = filter_preferred_codecs(CODECS[kind][:], transceiver._preferred_codecs)
    return transceiver


def _capability(kind: str, codec: str) -> RTCRtpCodecCapability:
    for each in RTCRtpSender.getCapabilities(kind).codecs:
        profile = each.parameters.get("profile-level-id", H264_PROFILE)
        if each.mimeType.lower() == f"{kind}/{codec}".lower() and profile == H264_PROFILE:
            return each
    raise ValueError(f"no {kind} codec {codec}")


def ask_for_no_delay(offer_sdp: str) -> str:
    """The offer with playout-delay in its video sections: a relay hands it on, and browsers show pictures at once."""
    lines: list[str] = []
    kind = ""
    for line in offer_sdp.splitlines():
        lines.append(line)
        if line.startswith("m="):
            kind = line[2:].split(" ", 1)[0]
        elif line.startswith("a=mid:") and kind == "video":
            lines.append(f"a=extmap:{PLAYOUT_DELAY_ID} {PLAYOUT_DELAY_URI}")
    return "\r\n".join(lines) + "\r\n"


def keep_answered_extensions(pc: RTCPeerConnection, answer_sdp: str) -> None:
    """Send those of ours that the answer has. Call right after setRemoteDescription, before anything is awaited."""
    by_mid: dict[str, dict[str, int]] = {}
    found: dict[str, int] = {}
    for line in answer_sdp.splitlines():
        if line.startswith("m="):
            found = {}
        elif line.startswith("a=mid:"):
            by_mid[line[6:].strip()] = found
        elif match := EXTMAP.match(line):
            found[match[2]] = int(match[1])
    for transceiver in pc.getTransceivers():
        answered = by_mid.get(transceiver.mid or "", {})
        wanted = (MID_URI, PLAYOUT_DELAY_URI) if transceiver.kind == "video" else (MID_URI,)
        keep_extensions(transceiver, {uri: answered[uri] for uri in wanted if uri in answered})
