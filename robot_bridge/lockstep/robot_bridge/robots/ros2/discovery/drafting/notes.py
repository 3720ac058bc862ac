"""Words for the comments in a robot's file, and times that follow from a measured rate."""

from collections.abc import Sequence

from lockstep.robot_bridge.robots.ros2.discovery.graph import Heard

__all__ = ["others", "rate_of", "timeout_for"]

SHOWN = 4


def rate_of(heard: Heard, seconds: float) -> str:
    """Return what was heard of a topic, in words."""
    if heard.count == 0:
        return f"published, but silent for {seconds:.0f} s"
    return "one message" if heard.rate is None else f"{heard.rate:.3g} Hz"


def others(names: Sequence[str]) -> str:
    """Return the end of a comment that names what else could have been chosen."""
    if not names:
        return ""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"; not {', '.join(names[:SHOWN])}{more}"


def timeout_for(rate: float | None, least: float = 0.5) -> float:
    """Return after how many seconds of silence a state is stale: eight messages, within the bounds of a setting."""
    return least if rate is None else min(max(least, round(8 / rate, 1)), 10.0)
