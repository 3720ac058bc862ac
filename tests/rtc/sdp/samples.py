"""Offers in the form of the stacks that write them: Chromium's own, and cut-down ones in the manner of the others."""

from pathlib import Path

from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.sdp import Codec, LocalMedia, SessionDescription, Transport, parse_description

__all__ = ["NAMES", "OPUS", "RTX", "TRANSPORT", "VP8", "everything", "parsed", "text_of"]

FOLDER = Path(__file__).parent / "offers"
NAMES = sorted(path.stem for path in FOLDER.glob("*.sdp"))

TRANSPORT = Transport(
    ufrag="abcd",
    password="0123456789abcdef0123456789",
    fingerprints=(Fingerprint("sha-256", ":".join(["AB"] * 32)),),
    setup="passive",
    candidates=("candidate:1 1 udp 2130706431 192.0.2.7 5000 typ host",),
    end_of_candidates=True,
)
VP8 = Codec(96, "VP8", 90_000, feedback=("nack", "nack pli", "goog-remb"))
H264 = Codec(97, "H264", 90_000, parameters={"packetization-mode": "1", "profile-level-id": "42e01f"})
RTX = Codec(98, "rtx", 90_000)
OPUS = Codec(111, "opus", 48_000, 2)


def text_of(name: str) -> str:
    return (FOLDER / f"{name}.sdp").read_text().replace("\n", "\r\n")


def parsed(name: str) -> SessionDescription:
    return parse_description(text_of(name))


def everything(offer: SessionDescription) -> dict[str, LocalMedia]:
    """What takes any section that there is."""
    extensions = tuple({each.uri for section in offer.sections for each in section.extensions})
    local = LocalMedia((VP8, H264, OPUS, RTX), extensions=extensions)
    return {section.mid: local for section in offer.sections}
