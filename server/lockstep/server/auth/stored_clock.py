"""The clock by which links end, with its newest time on disk."""

import time

import msgspec
import structlog

from lockstep.server.auth.invitation_clock import LinkClock
from lockstep.server.util.state_dir import StateDamaged, StateDir
from lockstep.server.util.steady_time import steady_time

__all__ = ["SEEN", "StoredClock"]

log = structlog.get_logger(__name__)

SEEN = "newest-time.json"
BEHIND_SECONDS = 60.0  # that a clock may be behind the newest time without a warning


class _Seen(msgspec.Struct, frozen=True):
    seen: float  # s since 1970: the newest time that any process saw


_seen = msgspec.json.Decoder(_Seen)


class StoredClock:
    """A `LinkClock` that goes on from the newest time on disk.

    Args:
        beside: a file; the time is written only once it is there, so that a time on disk proves that it was

    Attributes:
        began_at: that newest time at the start; 0 for none

    Raises:
        StateDirUnusable, StateDamaged: the time cannot be read or decoded.
    """

    def __init__(self, directory: StateDir, beside: str) -> None:
        self._directory = directory
        self._beside = beside
        self.began_at = self._read()
        self._clock = LinkClock(self.began_at, steady_time())
        if self.began_at > time.time() + BEHIND_SECONDS:
            text = "this machine's clock is behind the newest recorded time; links end by that time"
            log.warning(text, seen=self.began_at)

    def now(self) -> float:
        """Return the time by which links end, s since 1970; it never runs backwards."""
        return self._clock.at(time.time(), steady_time())

    def write(self) -> float:
        """Write the time to disk and return it; call it with the directory locked. Blocks."""
        self._clock.saw(self._read())
        now = self.now()
        if self._directory.version(self._beside) is not None:
            self._directory.write(SEEN, msgspec.json.encode(_Seen(now)))
        return now

    def _read(self) -> float:
        data = self._directory.read(SEEN)
        try:
            return 0.0 if data is None else _seen.decode(data).seen
        except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
            raise StateDamaged(self._directory.path / SEEN, f"the file is damaged: {error}") from error
