"""The battery of a simulated robot, as its status shows it."""

from typing import Final

from lockstep.protocol.actions import StatusItem, StatusLevel

__all__ = ["SimulatedBattery"]

LOW: Final = 0.2
EMPTY: Final = 0.05
LASTS: Final = 3 * 3600.0  # s of standing; moving costs three times as much
CHARGES: Final = 20 * 60.0  # s in which a charger fills it


class SimulatedBattery:
    """Runs down with time, and is full again when it is empty: a simulation goes on for weeks. A charger fills it."""

    def __init__(self, share: float = 0.87) -> None:
        self._share = share
        self._charges = False

    def tick(self, seconds: float, *, moving: bool, charging: bool = False) -> None:
        """`charging`: the robot stands at its charger."""
        self._charges = charging
        if charging:
            self._share = min(self._share + seconds / CHARGES, 1.0)
            return
        self._share -= seconds / LASTS * (3.0 if moving else 1.0)
        if self._share <= 0.0:
            self._share = 1.0

    def item(self) -> StatusItem:
        level: StatusLevel = "error" if self._share < EMPTY else "warning" if self._share < LOW else "ok"
        text = "" if level == "ok" else "it is charging" if self._charges else "charge it soon"
        share = round(self._share, 3)
        return StatusItem(name="battery", label="Battery", kind="battery", value=share, level=level, text=text)
