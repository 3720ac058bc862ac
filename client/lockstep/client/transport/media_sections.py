"""The sections of a session description for everything that the client can receive."""

from collections.abc import Mapping, Sequence
from typing import Literal

from lockstep.rtc.sdp import MID_URI, Codec, LocalMedia

__all__ = ["CODECS", "receiving"]

FEEDBACK = ("nack", "nack pli")
H264 = {"packetization-mode": "1", "level-asymmetry-allowed": "1"}
# Of H.264 the baseline profile, plain and constrained, which the encoders of the console and of relays make.
CODECS: Mapping[str, Sequence[Codec]] = {
    "video": (
        Codec(96, "VP8", 90_000, feedback=FEEDBACK),
        Codec(97, "rtx", 90_000, parameters={"apt": "96"}),
        Codec(98, "H264", 90_000, parameters=H264 | {"profile-level-id": "42001f"}, feedback=FEEDBACK),
        Codec(99, "rtx", 90_000, parameters={"apt": "98"}),
        Codec(100, "H264", 90_000, parameters=H264 | {"profile-level-id": "42e01f"}, feedback=FEEDBACK),
        Codec(101, "rtx", 90_000, parameters={"apt": "100"}),
    ),
    "audio": (Codec(111, "opus", 48_000, 2), Codec(0, "PCMU", 8000)),
}


def receiving(kind: Literal["video", "audio"], codec: str | None = None, extension: str | None = None) -> LocalMedia:
    """Return a section that receives.

    Args:
        codec: the only codec; None: any that the sender likes
        extension: the URI of the header extension that brings stamps; None: they come otherwise

    Raises:
        ValueError: there is no such codec.
    """
    known = CODECS[kind]
    names = dict.fromkeys(each.name for each in known if each.repairs is None)
    if codec is not None and codec not in names:
        raise ValueError(f"no codec {codec}; there are {' and '.join(names)}")
    chosen = [each for each in known if codec in (None, each.name)]
    numbers = {each.payload_type for each in chosen}
    repairs = [each for each in known if each.repairs in numbers and each not in chosen]
    extensions = (MID_URI,) if extension is None else (MID_URI, extension)
    return LocalMedia((*chosen, *repairs), "recvonly", extensions)
