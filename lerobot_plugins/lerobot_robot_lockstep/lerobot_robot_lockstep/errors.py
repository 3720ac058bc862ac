"""Errors of the plugin.

LockstepError               the console or the robot said no; `name` and `reason` say why
├── NoFreshObservation      no state and pictures that belong together came in time
└── LockstepLost            the connection, or the process that has it, ended (also a DeviceNotConnectedError)
"""

from lerobot.utils.errors import DeviceNotConnectedError

__all__ = ["LockstepError", "LockstepLost", "NoFreshObservation", "error_of"]


class LockstepError(Exception):
    """The console or the robot said no.

    Attributes:
        name: the client's name for it, such as "SeatRefused"
        reason: the protocol's name for it, such as "stopped"; "" without one
    """

    def __init__(self, text: str, name: str = "", reason: str = "") -> None:
        super().__init__(text)
        self.name = name
        self.reason = reason

    def __str__(self) -> str:
        return ": ".join(part for part in (self.name, str(self.args[0])) if part)


class NoFreshObservation(LockstepError):
    """No state and pictures that belong together came in time. What the gate refuses is no observation."""


class LockstepLost(LockstepError, DeviceNotConnectedError):
    """The connection ended; the robot comes to rest by itself."""

    def __init__(self, text: str, name: str = "", reason: str = "") -> None:
        LockstepError.__init__(self, text, name, reason)
        self.message = text


_KINDS: dict[str, type[LockstepError]] = {"NoFreshObservation": NoFreshObservation, "ConsoleLost": LockstepLost}


def error_of(answer: dict[str, object]) -> LockstepError:
    """Return the error that an answer of the pipe carries."""
    name = str(answer.get("error", ""))
    return _KINDS.get(name, LockstepError)(str(answer.get("text", "")), name, str(answer.get("reason", "")))
