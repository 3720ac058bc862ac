"""When each peer gets sender reports: spread over the interval and varied, more rarely in a crowd (RFC 3550 6.2)."""

import asyncio
import random
from collections.abc import Callable, Sequence
from typing import Protocol

__all__ = ["SenderReports", "due"]

REPORT_SECONDS = 1.0  # on average, up to so many peers
AT_ONCE = 50  # peers in one interval


class ReportedPeer(Protocol):
    """What it needs of a peer."""

    @property
    def comes_first(self) -> bool:
        """Whether it is no matter how many others there are."""

    def send_reports(self) -> None: ...


def due(peers: Sequence[ReportedPeer], turn: int) -> list[ReportedPeer]:
    """Who gets reports in an interval: who comes first in every one, of the others no more than `AT_ONCE`, in turn."""
    others = [peer for peer in peers if not peer.comes_first]
    turns = max(1, -(-len(others) // AT_ONCE))
    return [peer for peer in peers if peer.comes_first] + others[turn % turns :: turns]


class SenderReports:
    """Run `run` as a task."""

    def __init__(self, peers: Callable[[], Sequence[ReportedPeer]]) -> None:
        self._peers = peers

    async def run(self) -> None:
        """Until cancelled."""
        turn = 0
        while True:
            await asyncio.sleep(REPORT_SECONDS * random.uniform(0.5, 1.5))
            turn += 1
            for peer in due(self._peers(), turn):
                peer.send_reports()
                await asyncio.sleep(0)
