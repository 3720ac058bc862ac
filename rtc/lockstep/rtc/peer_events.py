"""The events of a peer for its user. Events of its data channels are in `lockstep.rtc.channels`."""

from dataclasses import dataclass
from typing import NamedTuple

from lockstep.rtc.addresses import Path
from lockstep.rtc.channels import ChannelEvent
from lockstep.rtc.ice.events import Answered, Restarted, RestartFailed
from lockstep.rtc.rtp.stage import StreamEvent
from lockstep.rtc.rtp.wire.packet import RtpPacket

__all__ = [
    "Answered",
    "Connected",
    "MediaEvent",
    "PacketReceived",
    "PathFound",
    "PeerEnded",
    "PeerEvent",
    "PlainRtcp",
    "PlainRtp",
    "RestartFailed",
    "Restarted",
]


@dataclass(frozen=True, slots=True)
class PathFound:
    """The path of datagrams from now on. None: a restart of ICE is to find another."""

    path: Path | None


@dataclass(frozen=True, slots=True)
class Connected:
    """DTLS is up: media and channels flow, with the peer that its session description names."""

    srtp_profile: str | None  # None: no media


@dataclass(frozen=True, slots=True)
class PacketReceived:
    """A packet of the peer's stream in section `mid`, decrypted. It may arrive before an earlier one."""

    mid: str
    packet: RtpPacket


class PlainRtp(NamedTuple):
    """A packet, decrypted and otherwise as it came, with `BundleMedia.plain`. A tuple for the sake of speed."""

    data: bytes


class PlainRtcp(NamedTuple):
    """A compound RTCP packet, in the same way."""

    data: bytes


@dataclass(frozen=True, slots=True)
class MediaEvent:
    """An event of the stream in section `mid`."""

    mid: str
    event: StreamEvent


@dataclass(frozen=True, slots=True)
class PeerEnded:
    """Nothing may be sent any more; the last event.

    `reason` is a stable name: "closed" by this side, "peer_closed", "no_path" and "consent_expired" of ICE,
    "dtls_protocol", "dtls_fingerprint", "dtls_timeout", "dtls_too_much_handshake", "failed": serving the peer has
    raised an unexpected exception.
    """

    reason: str
    detail: str = ""


PeerEvent = (
    PathFound
    | Answered
    | Restarted
    | RestartFailed
    | Connected
    | PacketReceived
    | PlainRtp
    | PlainRtcp
    | MediaEvent
    | ChannelEvent
    | PeerEnded
)
