"""A session description with one BUNDLE, as data (RFC 8866, RFC 8829, RFC 9143). Nothing here reads or writes text."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from lockstep.rtc.fingerprint import Fingerprint

__all__ = [
    "LARGEST_EXTENSION_ID",
    "MID_URI",
    "Codec",
    "Direction",
    "HeaderExtension",
    "MediaSection",
    "SessionDescription",
    "Setup",
    "Source",
    "SourceGroup",
    "Transport",
    "both",
    "rejection_of",
    "reverse",
]

Direction = Literal["sendrecv", "sendonly", "recvonly", "inactive"]
Setup = Literal["actpass", "active", "passive"]

MID_URI = "urn:ietf:params:rtp-hdrext:sdes:mid"  # RFC 9143 15.1
LARGEST_EXTENSION_ID = 255  # in the two-byte form; up to 14 in the one-byte form (RFC 8285 4.2, 4.3)

_WAYS: Mapping[Direction, tuple[bool, bool]] = {
    "sendrecv": (True, True),
    "sendonly": (True, False),
    "recvonly": (False, True),
    "inactive": (False, False),
}  # the writer sends, the writer receives
_DIRECTIONS = {ways: direction for direction, ways in _WAYS.items()}


def reverse(direction: Direction) -> Direction:
    """Return the direction as the other end sees it."""
    sends, receives = _WAYS[direction]
    return _DIRECTIONS[receives, sends]


def both(one: Direction, other: Direction) -> Direction:
    """Return the direction that `one` and `other` allow (RFC 3264 6.1)."""
    first, second = _WAYS[one], _WAYS[other]
    return _DIRECTIONS[first[0] and second[0], first[1] and second[1]]


@dataclass(frozen=True, slots=True)
class Codec:
    """A payload type and its codec."""

    payload_type: int  # 0 to 127
    name: str  # "VP8"; compared without case
    clock_rate: int  # Hz
    channels: int = 1  # of sound
    parameters: Mapping[str, str] = field(default_factory=dict)  # a=fmtp; {"apt": "96"}; a word without "=" has ""
    feedback: tuple[str, ...] = ()  # a=rtcp-fb; "nack", "nack pli", "transport-cc"

    @property
    def repairs(self) -> int | None:
        """The payload type that this one retransmits (RFC 4588 8.6); None for any other codec."""
        associated = self.parameters.get("apt", "")
        is_number = associated.isascii() and associated.isdecimal() and len(associated) <= 3
        return int(associated) if self.name.lower() == "rtx" and is_number else None


@dataclass(frozen=True, slots=True)
class HeaderExtension:
    """A header extension (RFC 8285 8)."""

    id: int  # 1 to 255; in an offer also 4096 to 4351: the answer is to choose one
    uri: str
    direction: Direction = "sendrecv"


@dataclass(frozen=True, slots=True)
class Source:
    """A stream that its writer sends (RFC 5576 4.1)."""

    ssrc: int
    attributes: Mapping[str, str] = field(default_factory=dict)  # {"cname": "…", "msid": "…"}


@dataclass(frozen=True, slots=True)
class SourceGroup:
    """Streams that belong together (RFC 5576 4.2)."""

    semantics: str  # "FID": a stream and its retransmissions
    ssrcs: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Transport:
    """ICE and DTLS of one end. All sections of a bundle share it."""

    ufrag: str
    password: str = field(repr=False)
    fingerprints: tuple[Fingerprint, ...]
    setup: Setup
    candidates: tuple[str, ...] = ()  # "candidate:…", without "a="
    end_of_candidates: bool = False
    ice_options: tuple[str, ...] = ()  # "trickle", "ice2"
    lite: bool = False  # RFC 8445 2.5


@dataclass(frozen=True, slots=True)
class MediaSection:
    """One m= section."""

    kind: str  # "audio", "video", "application"; others are never accepted
    mid: str
    protocol: str = "UDP/TLS/RTP/SAVPF"
    formats: tuple[str, ...] = ()  # of the m= line; kept for the rejection of unknown sections
    rejected: bool = False  # port 0 without bundle-only (RFC 3264 6)
    direction: Direction = "sendrecv"
    codecs: tuple[Codec, ...] = ()  # the preferred one first
    extensions: tuple[HeaderExtension, ...] = ()
    sources: tuple[Source, ...] = ()
    source_groups: tuple[SourceGroup, ...] = ()
    msid: str = ""  # "stream track" (RFC 8830); "" without
    rtcp_mux: bool = True
    reduced_size: bool = False  # RTCP packets that are not compound (RFC 5506)
    sctp_port: int | None = None  # of data channels (RFC 8841 5)
    max_message_size: int | None = None  # bytes; None: the 65536 of RFC 8841 6.1; 0: any
    channel_maps: tuple[str, ...] = ()  # a=dcmap of data channels that need no opening message (RFC 8864 5.1)

    @property
    def is_media(self) -> bool:
        return self.kind in ("audio", "video")

    def extension_id(self, uri: str) -> int | None:
        """Return the id of a header extension; None when it is not in use here."""
        return next((each.id for each in self.extensions if each.uri == uri), None)

    def repair_of(self, codec: Codec) -> Codec | None:
        """Return the codec by which `codec` is retransmitted; None without one."""
        return next((each for each in self.codecs if each.repairs == codec.payload_type), None)

    def repair_source(self, ssrc: int) -> int | None:
        """Return the SSRC that retransmits stream `ssrc` (RFC 4588 8.3); None when that is not said."""
        groups = [each.ssrcs for each in self.source_groups if each.semantics == "FID" and len(each.ssrcs) == 2]
        return next((repair for original, repair in groups if original == ssrc), None)


def rejection_of(kind: str, mid: str, protocol: str, formats: tuple[str, ...]) -> MediaSection:
    """Return a section that is not in use, and keeps its place (RFC 3264 6)."""
    return MediaSection(kind, mid, protocol, formats, rejected=True, direction="inactive", rtcp_mux=False)


@dataclass(frozen=True, slots=True)
class SessionDescription:
    """All media sections, and the one transport of the bundle."""

    transport: Transport
    sections: tuple[MediaSection, ...]
    session_id: int = 0  # RFC 8866 5.2
    version: int = 1  # goes up with each description of the same end
    allow_mixed: bool = False  # one- and two-byte header extensions in one stream (RFC 8285 6)

    @property
    def accepted(self) -> tuple[MediaSection, ...]:
        """The sections that are in the bundle."""
        return tuple(section for section in self.sections if not section.rejected)

    def section(self, mid: str) -> MediaSection | None:
        return next((section for section in self.sections if section.mid == mid), None)
