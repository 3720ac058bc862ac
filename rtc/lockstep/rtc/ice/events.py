"""The events of an ICE agent for its user."""

from dataclasses import dataclass
from typing import Literal

from lockstep.rtc.addresses import Path

__all__ = ["Answered", "Ended", "Event", "PathChanged", "RestartFailed", "Restarted"]


@dataclass(frozen=True, slots=True)
class PathChanged:
    """The path to send on from now on. None: no path, until a restart that is under way has found one."""

    path: Path | None
    nominated: bool  # False: it works, and the controlling agent has not decided yet (RFC 8445 12.1)


@dataclass(frozen=True, slots=True)
class Answered:
    """The peer has answered a check on the path in use: its round trip is at most `seconds`."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Restarted:
    """The restart found a path, which may be the one before; data take it from now on."""


@dataclass(frozen=True, slots=True)
class RestartFailed:
    """The restart found no path. The path before it goes on for as long as the peer consents."""


@dataclass(frozen=True, slots=True)
class Ended:
    """Nothing may be sent any more; the last event."""

    reason: Literal["no_path", "consent_expired"]


Event = PathChanged | Answered | Restarted | RestartFailed | Ended
