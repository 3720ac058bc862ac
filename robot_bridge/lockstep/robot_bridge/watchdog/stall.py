"""Detects that the ticks were held up: by a call that blocked, a busy machine, or a suspend. No I/O, no clock."""

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.errors import DescriptionError

__all__ = ["LONG", "StallGauge", "watchdog_seconds"]

SHORTEST = 0.1  # s
MISSED = 3  # ticks
LONG = 1.0  # s; a gap this long counts even if nothing moved: it is a suspend


def watchdog_seconds(description: RobotDescription, longest_tick: float) -> float:
    """Return the seconds without a tick after which the robot is brought to rest; always less than `hold`.

    Args:
        longest_tick: the most seconds from one tick to the next while nothing holds them up

    Raises:
        DescriptionError: they are so few that the watchdog would act while nothing is wrong.
    """
    seconds, name = description.watchdog, "watchdog"
    if seconds is None:
        seconds, name = min(max(MISSED * longest_tick, SHORTEST), description.hold / 2), "half of hold"
    if seconds <= longest_tick:
        raise DescriptionError(
            f"{name} must be longer than the {longest_tick:g} s that may pass between two ticks, not {seconds:g} s"
        )
    return seconds


class StallGauge:
    """Measures the gaps between ticks. Call `tick` at every tick, before anything is applied."""

    def __init__(self, limit: float, now: float) -> None:
        self._limit = limit
        self._last = now

    def tick(self, now: float, moving: bool) -> float | None:
        """Return the seconds since the last tick if that was too long for a robot that moves (or stands); else None."""
        gap, self._last = now - self._last, now
        return gap if gap > (self._limit if moving else max(self._limit, LONG)) else None
