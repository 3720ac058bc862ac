"""Detects that the ticks were held up: by a call that blocked, a busy machine, or a suspend. No I/O, no clock."""

from lockstep.protocol.description import RobotDescription

__all__ = ["LONG", "StallGauge", "watchdog_seconds"]

SHORTEST = 0.1  # s
MISSED = 3  # ticks
LONG = 1.0  # s; a gap this long counts even if nothing moved: it is a suspend


def watchdog_seconds(description: RobotDescription, tick_seconds: float) -> float:
    """Return the seconds without a tick after which the robot is brought to rest; always less than `hold`."""
    if description.watchdog is not None:
        return description.watchdog
    return min(max(MISSED * tick_seconds, SHORTEST), description.hold / 2)


class StallGauge:
    """Measures the gaps between ticks. Call `tick` at every tick, before anything is applied."""

    def __init__(self, limit: float, now: float) -> None:
        self._limit = limit
        self._last = now

    def tick(self, now: float, moving: bool) -> float | None:
        """Return the seconds since the last tick if that was too long for a robot that moves (or stands); else None."""
        gap, self._last = now - self._last, now
        return gap if gap > (self._limit if moving else max(self._limit, LONG)) else None
