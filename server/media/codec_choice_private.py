"""Which codec a media section is answered with; aiortc has no public way to say it. Tests pin what is used:

- `RTCRtpTransceiver._codecs`: the answer is built from it
- `aiortc.codecs.CODECS`: what is offered is compared with it
"""

from collections.abc import Sequence
from dataclasses import replace

from aiortc import RTCRtpTransceiver
from aiortc.codecs import CODECS
from aiortc.rtcrtpparameters import RTCRtpCodecParameters

from server.media.h264 import Profile, profile_of_fmtp

__all__ = ["keep_codec", "negotiated_h264"]

MORE_H264_PROFILES = ("4d001f", "64001f")  # Main and High


def keep_codec(transceiver: RTCRtpTransceiver, names: Sequence[str], *, h264_first: bool = False) -> str | None:
    """Answer the first offered codec among `names`, with its retransmission format; None when there is none.

    `h264_first`: before all others H.264, of the largest profile that is offered.
    """
    codecs = transceiver._codecs
    known = {name.lower(): name for name in names}
    possible = [codec for codec in codecs if codec.name.lower() in known]
    if not possible:
        return None
    chosen = max(possible, key=_profile_rank) if h264_first else possible[0]
    transceiver._codecs = [chosen] + [
        codec for codec in codecs if codec.name.lower() == "rtx" and codec.parameters.get("apt") == chosen.payloadType
    ]
    return known[chosen.name.lower()]


def _profile_rank(codec: RTCRtpCodecParameters) -> int:
    """The larger, the more streams fit; equal ones come as they are offered."""
    if codec.name.lower() != "h264":
        return 0
    profile = profile_of_fmtp(str(codec.parameters.get("profile-level-id", "")))
    return 1 if profile.constrained else profile.idc


def negotiated_h264(transceiver: RTCRtpTransceiver) -> Profile | None:
    """What is answered, after `keep_codec`; None for another codec."""
    codec = transceiver._codecs[0]
    if codec.name.lower() != "h264":
        return None
    return profile_of_fmtp(str(codec.parameters.get("profile-level-id", "")))


def _know_h264_profiles() -> None:
    """aiortc answers H.264 of the baseline profiles only; most cameras encode Main or High."""
    known = {str(codec.parameters.get("profile-level-id")) for codec in CODECS["video"]}
    taken = max(codec.payloadType or 0 for codec in CODECS["video"])
    for number, profile in enumerate(MORE_H264_PROFILES):
        if profile not in known:
            main = next(codec for codec in CODECS["video"] if codec.name == "H264")
            payload_type = taken + 1 + 2 * number
            parameters = {**main.parameters, "profile-level-id": profile}
            repair = RTCRtpCodecParameters("video/rtx", 90_000, None, payload_type + 1, [], {"apt": payload_type})
            CODECS["video"] += [replace(main, payloadType=payload_type, parameters=parameters), repair]


_know_h264_profiles()
