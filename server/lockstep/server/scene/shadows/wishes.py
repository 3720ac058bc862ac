"""Keeps the newest of what each shadow policy wants, for the 3D scene. No I/O, no clock."""

from typing import Final

from lockstep.protocol.console import ShadowVerdict
from lockstep.protocol.serial import event_gap

__all__ = ["ShadowWishes"]

MOST: Final = 8  # policies, as many as are judged at once
OLD_EVENTS: Final = 25
OLD_SECONDS: Final = 2.0


class ShadowWishes:
    def __init__(self) -> None:
        self._newest: dict[str, tuple[ShadowVerdict, float]] = {}  # by peer, in the order of their first wish

    def take(self, verdict: ShadowVerdict, now: float) -> None:
        """Take a verdict; one whose values could not be compared says nothing of where the robot should be."""
        if verdict.judgement not in ("in_time", "out_of_limits"):
            return
        self._newest[verdict.peer] = (verdict, now)
        while len(self._newest) > MOST:
            del self._newest[min(self._newest, key=lambda peer: self._newest[peer][1])]

    def of_now(self, event: int, now: float) -> list[ShadowVerdict]:
        """Return what is wanted about this event, and forget what is old."""
        self._newest = {peer: each for peer, each in self._newest.items() if now - each[1] <= OLD_SECONDS}
        verdicts = (verdict for verdict, _ in self._newest.values())
        return [each for each in verdicts if abs(event_gap(event, each.event)) <= OLD_EVENTS]
