"""The times of the control seat: how long its holder may be silent, and how long idle. No I/O, no clock.

A lost packet silences a browser's data channels for a round trip or two, and once more until SCTP has told the other
side what it gave up, so that a silence has to be longer on a longer path. The robot does not wait for it: without
commands it rests within its `hold`.
"""

from typing import NamedTuple

__all__ = ["COUNTDOWN", "Heartbeat", "IdleTime", "SeatTimes"]

COUNTDOWN = 30.0  # s before the idle release, announced to everyone
ROUND_TRIPS, MOST_ROUND_TRIPS = 4, 5.0  # by which a silence may be longer on a long path, and their bound in s


class SeatTimes(NamedTuple):
    """Time limits of the seat, in seconds."""

    heartbeat: float = 3.0  # of silence, and some round trips of the holder's path
    idle: float = 300.0  # without an intention to move
    claim: float = 60.0  # until a claim counts as declined


class Heartbeat:
    """The time since a peer, or a person with several connections, was heard."""

    def __init__(self, timeout: float) -> None:
        """`timeout`: s of silence, on a path without delay."""
        self._timeout = timeout
        self._heard_at = 0.0
        self._round_trip = 0.0

    def heard(self, now: float, round_trip: float = 0.0) -> None:
        """Called for each message. `round_trip`: s, as measured last; 0 before the first measurement."""
        self._heard_at, self._round_trip = now, round_trip

    def is_lost(self, now: float) -> bool:
        return now - self._heard_at >= self._timeout + min(ROUND_TRIPS * self._round_trip, MOST_ROUND_TRIPS)


class IdleTime:
    """The time since the holder last had an intention to move, with a countdown at its end."""

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._moved_at = 0.0
        self._counting = False  # everyone was told of the countdown

    def restart(self, now: float) -> bool:
        """Begin anew. Return True if that ends a countdown."""
        self._moved_at = now
        counting, self._counting = self._counting, False
        return counting

    def is_over(self, now: float) -> bool:
        return now >= self._moved_at + self._limit

    def begins_countdown(self, now: float) -> bool:
        """Return True once, when the countdown begins."""
        if self._counting or now < self._moved_at + self._limit - COUNTDOWN:
            return False
        self._counting = True
        return True

    def seconds_left(self, now: float) -> float | None:
        """Return the seconds until the holder loses the seat; None unless everyone is to see the countdown."""
        return max(0.0, self._moved_at + self._limit - now) if self._counting else None
