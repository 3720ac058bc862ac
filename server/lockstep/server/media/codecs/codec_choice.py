"""Chooses the codec that answers a section of an offer, and the codecs that the console offers to a relay."""

from collections.abc import Sequence

from lockstep.rtc.sdp import Codec, MediaSection
from lockstep.rtc.sdp.codecs import common_codecs
from lockstep.server.media.codecs.h264 import Profile, profile_of_fmtp

__all__ = ["OFFERED_PROFILE", "OPUS", "chosen_codecs", "h264_profile", "known_codecs", "offered_codecs"]

FEEDBACK = ("nack", "nack pli", "goog-remb")
H264 = {"packetization-mode": "1", "level-asymmetry-allowed": "1"}
H264_PROFILES = ("42001f", "42e01f", "4d001f", "64001f")  # baseline, constrained baseline, main, high
OFFERED_PROFILE = "42e01f"  # every browser takes it

OPUS = Codec(111, "opus", 48_000, 2)
VIDEO = (
    Codec(96, "VP8", 90_000, feedback=FEEDBACK),
    Codec(97, "rtx", 90_000, parameters={"apt": "96"}),
    *(
        Codec(number, "H264", 90_000, parameters=H264 | {"profile-level-id": profile}, feedback=FEEDBACK)
        for number, profile in enumerate(H264_PROFILES, 98)
    ),
)
# PCMA and G.722 are not sent: a section with nothing else is answered inactive.
SOUND = (OPUS, Codec(0, "PCMU", 8000), Codec(8, "PCMA", 8000), Codec(9, "G722", 8000))


def known_codecs(kind: str) -> Sequence[Codec]:
    """Return all codecs that an answer may name for "video" or "audio"."""
    return VIDEO if kind == "video" else SOUND


def chosen_codecs(section: MediaSection, names: Sequence[str], *, h264_first: bool = False) -> tuple[Codec, ...]:
    """Return the offer's first codec that is among `names`, and its repair codec; empty when there is none.

    `h264_first`: prefer H.264, of the largest profile that is offered.
    """
    known = {name.lower() for name in names}
    common = {each.payload_type: each for each in common_codecs(section.codecs, known_codecs(section.kind))}
    possible = [each for each in section.codecs if each.payload_type in common and each.name.lower() in known]
    if not possible:
        return ()
    best = max(possible, key=_profile_rank) if h264_first else possible[0]
    chosen, repair = common[best.payload_type], section.repair_of(best)
    return (chosen,) if repair is None else (chosen, repair)


def offered_codecs(kind: str, name: str) -> tuple[Codec, ...]:
    """Return one codec, and its repair codec, for an offer of the console. Raises ValueError for an unknown codec."""
    for number, each in enumerate(known_codecs(kind)):
        profile = each.parameters.get("profile-level-id", OFFERED_PROFILE)
        if each.name.lower() == name.lower() and profile == OFFERED_PROFILE:
            if kind != "video":
                return (each,)
            first = 96 + 2 * number
            repair = Codec(first + 1, "rtx", each.clock_rate, parameters={"apt": str(first)})
            return (Codec(first, each.name, each.clock_rate, parameters=each.parameters, feedback=FEEDBACK), repair)
    raise ValueError(f"no {kind} codec {name}")


def _profile_rank(codec: Codec) -> int:
    """Return a rank: the larger, the more streams fit the profile. Equal ranks keep the order of the offer."""
    profile = h264_profile(codec)
    if profile is None:
        return 0
    return 1 if profile.constrained else profile.idc


def h264_profile(codec: Codec) -> Profile | None:
    """Return the H.264 profile of `codec`; None for another codec."""
    if codec.name.lower() != "h264":
        return None
    return profile_of_fmtp(str(codec.parameters.get("profile-level-id", "")))
