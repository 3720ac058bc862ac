"""When each peer gets sender reports: spread over the interval and varied, more rarely in a crowd (RFC 3550 6.2).

A round trip tells of the queue that the last report met, so whoever the operator's pictures depend on gets them three
times as often: a queue of a few hundred milliseconds is to be seen before it has grown to a second. Over the narrowest
paths that is a hundredth of what passes; RTCP may take a twentieth (RFC 4585 3.4, without a least interval).
"""

import asyncio
import random
from collections.abc import Callable, Sequence
from typing import Protocol

__all__ = ["OFTEN", "SenderReports", "due"]

REPORT_SECONDS = 1.0  # on average, up to so many peers
AT_ONCE = 50  # peers in one interval
OFTEN = 3  # turns in an interval; who comes first has each of them


class ReportedPeer(Protocol):
    """What it needs of a peer."""

    @property
    def comes_first(self) -> bool:
        """Whether it is no matter how many others there are."""

    def send_reports(self) -> None: ...


def due(peers: Sequence[ReportedPeer], turn: int) -> list[ReportedPeer]:
    """Who gets reports in a turn: who comes first in every one, of the others no more than `AT_ONCE` in an interval."""
    first = [peer for peer in peers if peer.comes_first]
    interval, place = divmod(turn, OFTEN)
    if place:
        return first
    others = [peer for peer in peers if not peer.comes_first]
    intervals = max(1, -(-len(others) // AT_ONCE))
    return first + others[interval % intervals :: intervals]


class SenderReports:
    """Run `run` as a task."""

    def __init__(self, peers: Callable[[], Sequence[ReportedPeer]]) -> None:
        self._peers = peers

    async def run(self) -> None:
        """Until cancelled."""
        turn = 0
        while True:
            await asyncio.sleep(REPORT_SECONDS / OFTEN * random.uniform(0.5, 1.5))
            turn += 1
            for peer in due(self._peers(), turn):
                peer.send_reports()
                await asyncio.sleep(0)
