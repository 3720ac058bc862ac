"""Tells the operator, the event log and the counters how each action does."""

from collections.abc import Callable
from functools import partial

import msgspec

from lockstep.protocol.actions import ActionUpdate
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import encode_message
from lockstep.robot_bridge.actions.request_outcomes import RequestOutcomes
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.link_transport import LinkTransport

__all__ = ["ActionReports"]

NOTED = 64  # ends of actions whose time is known; a newcomer is told fewer
KEYS = 32  # updates that may wait for a link that cannot take more; a further one takes the place of an older one


class ActionReports:
    """Updates of actions, on their way to the operator link while there is one."""

    def __init__(
        self, outcomes: RequestOutcomes, counters: BridgeCounters, log: EventLog, now: Callable[[], float]
    ) -> None:
        self._outcomes = outcomes
        self._counters = counters
        self._log = log
        self._now = now
        self._link: LinkTransport | None = None  # of the operator
        self._noted: dict[str, float] = {}  # id -> s, when the action ended; oldest first
        self._keys: dict[str, int] = {}  # id -> its key among the messages that wait

    def link_opened(self, link: LinkTransport) -> None:
        """Tell a new operator link of the newest actions."""
        self._link = link
        now = self._now()
        for update in self._outcomes.newest():
            self._send(msgspec.structs.replace(update, age=max(0.0, now - self._noted.get(update.id, now))))

    def link_lost(self) -> None:
        self._link = None

    def tell(self, update: ActionUpdate | None, *, is_new: bool = True) -> None:
        """Send an update on the operator link. `is_new`: count and record it too; False for repeats and progress."""
        if update is None:
            return
        if is_new:
            self.note(update)
        self._send(update)

    def note(self, update: ActionUpdate) -> None:
        """Count and record the begin or the end of an action."""
        if update.state != "running" and update.id in self._outcomes:
            self._noted.setdefault(update.id, self._now())
            if len(self._noted) > NOTED:
                del self._noted[next(iter(self._noted))]
        self._counters.actions[update.state] += 1
        self._log.record(
            "action", update.event, id=update.id, name=update.name, state=update.state, reason=update.reason
        )

    def _send(self, update: ActionUpdate) -> None:
        """Send on the operator link. Updates of one action replace each other while the link cannot take more."""
        if self._link is None:
            return
        key = self._keys.setdefault(update.id, len(self._keys))
        if len(self._keys) > KEYS:
            key = self._keys[update.id] = self._keys.pop(next(iter(self._keys)))
        self._link.send_encoded(f"action {key}", partial(_encoded, update))


def _encoded(update: ActionUpdate) -> bytes:
    return frame(encode_message(update))
