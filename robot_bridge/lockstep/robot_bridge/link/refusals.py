"""Sends refusals, counts them and records them."""

from lockstep.protocol.messages import Refusal
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.link_transport import LinkTransport

__all__ = ["Refusals"]


class Refusals:
    def __init__(self, counters: BridgeCounters, log: EventLog) -> None:
        self._counters = counters
        self._log = log

    def send(self, peer: LinkTransport, refusal: Refusal) -> None:
        self._counters.refusals[refusal.reason] += 1
        self._log.record("refused", refusal.event, reason=refusal.reason, current=refusal.current)
        peer.send(refusal)
