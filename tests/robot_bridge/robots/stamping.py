"""A stamper out of a function that says what holds now."""

from collections.abc import Callable

from lockstep.robot_bridge.robots.base import Stamp

__all__ = ["Stamping"]


class Stamping:
    """Knows only now; of earlier times it knows nothing."""

    def __init__(self, now: Callable[[], Stamp]) -> None:
        self._now = now

    def __call__(self) -> Stamp:
        return self._now()

    def at(self, time: float) -> Stamp | None:
        return None
