"""Reports the state of this process to the service manager that started it: sd_notify(3), a datagram for each state."""

import logging
import os
import socket
from collections.abc import Mapping
from contextlib import suppress

__all__ = ["ServiceManager"]

_logger = logging.getLogger(__name__)


class ServiceManager:
    """Sends states to the service manager, if there is one.

    Attributes:
        watchdog_seconds: it restarts a process that is not `alive` for that long; None: no watchdog
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        """`environment`: has NOTIFY_SOCKET and, for sd_watchdog_enabled(3), WATCHDOG_USEC and WATCHDOG_PID."""
        self._address = _address(environment.get("NOTIFY_SOCKET", ""))
        self._socket: socket.socket | None = None
        self._failed = False
        self.watchdog_seconds = _watchdog_seconds(environment) if self._address else None

    def ready(self) -> None:
        self._say(b"READY=1")

    def alive(self) -> None:
        """Report a sign of life; call it more often than every `watchdog_seconds`."""
        if self.watchdog_seconds is not None:
            self._say(b"WATCHDOG=1")

    def stopping(self) -> None:
        self._say(b"STOPPING=1")

    def close(self) -> None:
        """Close the socket. May be called again."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _say(self, state: bytes) -> None:
        """Send a state without blocking: a message that the manager does not take now is lost."""
        if not self._address:
            return
        try:
            if self._socket is None:
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
                self._socket.setblocking(False)
            self._socket.sendto(state, self._address)
        except OSError as error:
            if not self._failed:
                self._failed = True
                _logger.error("cannot notify the service manager at %s: %s", os.fsdecode(self._address), error)


def _address(name: str) -> bytes:
    """Return a path, or an abstract name for a name after "@"; b"" for anything else."""
    if name.startswith("@"):
        return b"\0" + os.fsencode(name[1:])
    return os.fsencode(name) if name.startswith("/") else b""


def _watchdog_seconds(environment: Mapping[str, str]) -> float | None:
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return None  # meant for the parent of this process
    with suppress(ValueError):
        microseconds = int(environment.get("WATCHDOG_USEC", ""))
        return microseconds / 1e6 if microseconds > 0 else None
    return None
