"""The settings of a peer, and the error of one that is not up."""

from dataclasses import dataclass, field

from lockstep.rtc.dtls import DtlsSettings
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.sctp import SctpSettings
from lockstep.rtc.sdp import LocalMedia, Setup

__all__ = ["OfferedMedia", "PeerNotReady", "PeerSettings"]


class PeerNotReady(RuntimeError):
    """The peer has no such stream or no channels: not negotiated, not yet, or not any more."""


@dataclass(frozen=True, slots=True)
class PeerSettings:
    """The settings of a peer that an application may change."""

    ice: IceSettings = field(default_factory=IceSettings)
    dtls: DtlsSettings = field(default_factory=DtlsSettings)
    sctp: SctpSettings = field(default_factory=SctpSettings)
    # The DTLS role of an answer, where the offer leaves the choice (RFC 8842 5.3). A peer that asks for a path is the
    # first to know that ICE has found one.
    setup: Setup = "passive"
    epoch: float = 0.0  # s since 1970 at which the clock of `now` was 0; for sender reports
    held: int = 32  # datagrams of DTLS that overtake the description they need; a handshake has fewer


@dataclass(frozen=True, slots=True)
class OfferedMedia:
    """A section of an offer of this side."""

    mid: str
    kind: str  # "audio" or "video"
    media: LocalMedia
