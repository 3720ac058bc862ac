"""The settings of a connection to a console."""

from dataclasses import dataclass
from pathlib import Path

from lockstep.client.console_url import ConsoleLink
from lockstep.client.control.command_gate import Pacing
from lockstep.client.media.media_gate import GateMode
from lockstep.client.transport.webrtc_transport import Route
from lockstep.protocol.carriers import Carrier

__all__ = ["ConnectionOptions"]


@dataclass(frozen=True)
class ConnectionOptions:
    """The arguments of `Console`."""

    link: ConsoleLink
    pacing: Pacing
    tolerance: dict[str, int]  # by kind of medium
    gate: GateMode
    carrier: Carrier
    video: int
    audio: bool
    decode: bool
    codec: str | None
    sound_codec: str | None
    event_rate: float | None
    name: str
    connect_seconds: float
    silence_seconds: float
    route: Route | None
    tls_ca: Path | None = None
    relay_only: bool = False
    through_relay: bool = False
