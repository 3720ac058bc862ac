"""Asks the robot for its status at intervals, and checks the answer. No I/O, no clock: the caller hands in `now`."""

import logging
import math
from collections.abc import Callable, Sequence

import msgspec

from lockstep.protocol.actions import (
    MAX_STATUS_BYTES,
    MAX_STATUS_ITEMS,
    Status,
    StatusItem,
    fits_kind,
    status_item_bytes,
)
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["StatusIssuer"]

INTERVAL = 0.5  # s between two messages, unless the hardware stop has changed
LEAST_INTERVAL = 0.05  # s, also then

_logger = logging.getLogger(__name__)


class StatusIssuer:
    """Call `look` once a tick; it returns a status when one is due."""

    def __init__(self, robot: Robot, own: Callable[[], Sequence[StatusItem]] = tuple) -> None:
        """`own`: the bridge's own items, which come before the robot's."""
        self._robot = robot
        self._own = own
        self._issued_at = -math.inf
        self._pressed: bool | None = None
        self._has_any = False  # a status was issued before: an empty one is news then
        self._left_out: set[str] = set()  # names of items that did not fit and were logged

    def want_issue(self) -> None:
        """Issue at the next tick, because a client joined."""
        self._issued_at = -math.inf

    def look(self, now: float, event: int) -> Status | None:
        """Return the status if it is due.

        Raises:
            BaseException: the adapter raised.
        """
        pressed = self._robot.hardware_stop()
        since = now - self._issued_at
        if since < LEAST_INTERVAL or (since < INTERVAL and pressed == self._pressed):
            return None
        self._issued_at, self._pressed = now, pressed
        items = [] if pressed is None else [_hardware_stop(pressed)]
        names = {item.name for item in items}
        room = MAX_STATUS_BYTES - sum(map(status_item_bytes, items))
        for item in (*self._own(), *self._robot.status()):
            if item.name in names or not self._fits(item):
                continue
            size = status_item_bytes(item)
            if size > room:
                self._leave_out(item, f"does not fit into the {MAX_STATUS_BYTES} bytes of a status")
                continue
            room -= size
            names.add(item.name)
            items.append(item)
        if not items and not self._has_any:
            return None
        self._has_any = True
        return Status(event=event, items=items[:MAX_STATUS_ITEMS])

    def _fits(self, item: StatusItem) -> bool:
        """Return whether a console would take this item; log the first that it would not."""
        try:
            msgspec.convert(msgspec.to_builtins(item), StatusItem)
            fits = fits_kind(item) and status_item_bytes(item) > 0  # which raises for text that is no Unicode
        except (msgspec.ValidationError, TypeError, UnicodeError):
            fits = False
        if not fits:
            self._leave_out(item, "does not fit its kind or its bounds")
        return fits

    def _leave_out(self, item: StatusItem, why: str) -> None:
        if len(self._left_out) < MAX_STATUS_ITEMS and item.name not in self._left_out:
            self._left_out.add(item.name)
            _logger.warning("the status item %r %s, and is left out", item.name[:200], why)


def _hardware_stop(pressed: bool) -> StatusItem:
    return StatusItem(
        name="hardware_stop",
        label="Hardware stop",
        kind="hardware_stop",
        value=pressed,
        level="error" if pressed else "ok",
        text="pressed at the robot" if pressed else "",
    )
