"""Reads batteries from sensor_msgs/BatteryState, for the robot's status."""

import math
from typing import Any, NamedTuple

from lockstep.protocol.actions import StatusItem, StatusLevel
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide, header_ns
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.settings import Battery

__all__ = ["BatteryTopic", "Charge", "charge_of"]

CHARGING = 1  # POWER_SUPPLY_STATUS_CHARGING
HEALTHS = {2: "it is too hot", 3: "it is dead", 4: "its voltage is too high", 5: "it failed", 6: "it is too cold"}
MOST_VOLTS = 1e5


class Charge(NamedTuple):
    """The content of a message. A quantity that it leaves out is None."""

    share: float | None  # 0 to 1
    volts: float | None
    charging: bool
    trouble: str  # "" while its health is good, or unknown


def charge_of(message: Any) -> Charge:
    """Read a message. What is not measured is NaN in it; a percentage may be missing beside charge and capacity."""
    share = float(message.percentage)
    if not math.isfinite(share):
        charge, capacity = float(message.charge), float(message.capacity)
        share = charge / capacity if math.isfinite(charge) and capacity > 0 else math.nan
    volts = float(message.voltage)
    return Charge(
        share=min(1.0, max(0.0, share)) if math.isfinite(share) else None,
        volts=volts if math.isfinite(volts) and 0 < volts < MOST_VOLTS else None,
        charging=int(message.power_supply_status) == CHARGING,
        trouble=HEALTHS.get(int(message.power_supply_health), ""),
    )


class BatteryTopic:
    """One battery: its charge, and its voltage where the charge is not known."""

    def __init__(self, ros: RosSide, settings: Battery) -> None:
        self._settings = settings
        self._charges: Newest[Charge] = Newest(settings.topic, settings.timeout)
        ros.subscribe(ros.interface("sensor_msgs/msg/BatteryState"), settings.topic, self._take)

    def items(self, now: float) -> list[StatusItem]:
        """Return its item; none before the first message. An old reading has its age."""
        last = self._charges.last()
        if last is None:
            return []
        charge, settings = last.value, self._settings
        known = charge.share if charge.share is not None else charge.volts
        if known is None:
            return []
        level, text = self._judged(charge)
        return [
            StatusItem(
                name=settings.name,
                label=settings.label or settings.name,
                kind="number" if charge.share is None else "battery",
                value=round(known, 3),
                unit="V" if charge.share is None else "",
                level=level,
                text=text,
                age=max(0.0, now - last.time),
                old_after=settings.timeout,
            )
        ]

    def _judged(self, charge: Charge) -> tuple[StatusLevel, str]:
        if charge.trouble:
            return "error", charge.trouble
        if charge.share is None or charge.charging or charge.share >= self._settings.low:
            return "ok", ""
        return ("error", "it is empty") if charge.share < self._settings.empty else ("warning", "charge it soon")

    def _take(self, message: Any) -> None:
        self._charges.put(charge_of(message), clock.now(), header_ns(message.header))
