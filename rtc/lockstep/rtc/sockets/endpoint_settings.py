"""The settings of an endpoint."""

from dataclasses import dataclass, field

from lockstep.rtc.bundle.settings import PeerSettings
from lockstep.rtc.ice.port import PortSettings
from lockstep.rtc.sockets.tcp_port import TcpPortSettings

__all__ = ["EndpointSettings"]


@dataclass(frozen=True, slots=True)
class EndpointSettings:
    peer: PeerSettings = field(default_factory=PeerSettings)
    port: PortSettings = field(default_factory=PortSettings)
    tcp: TcpPortSettings = field(default_factory=TcpPortSettings)
    peers: int = 1024  # at a time; each has at most half a megabyte of buffers
    waiting_packets: int = 4096  # media packets that an application has not read; more are dropped and counted
    ask_seconds: float = 3.0  # time to wait for STUN and TURN servers
    ask_margin: float = 0.2  # s, at least, for the slower servers after the first has answered
    waiting_datagrams: int = 1024  # of a connection that has turns; more are dropped and counted
    waiting_events: int = 16_384  # of all kinds; an application that lets more wait counts as dead: the peer is closed
