"""Reads a client's logs while a run goes on: they keep only the newest entries."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, NamedTuple

from lockstep.bench.experiment.judge.age_gate import passes
from lockstep.bench.experiment.judge.record import Arrival, ClientRecord, Rendered, fresh

__all__ = ["Look", "Observation"]

INTERVAL = 1.0  # s between two looks; logs keep a thousand entries, the fastest stream has 50 a second


class Look(NamedTuple):
    """The state of a client's logs at one moment, times on this machine's monotonic clock."""

    feedbacks: Sequence[Arrival]
    rendered: dict[str, Sequence[Rendered]]
    statistics: dict[str, Any]


class Observation:
    """Reads a client's logs. Call `begin`, then run `run` until cancelled, then call `end`."""

    def __init__(self, record: ClientRecord, look: Callable[[], Awaitable[Look]]) -> None:
        self._record = record
        self._look = look

    async def begin(self) -> None:
        """Begin; earlier entries do not count."""
        look = await self._look()
        self._record.statistics_before = look.statistics
        self._take(look)
        self._record.feedbacks[:-1] = []  # the run begins with the newest event
        for stream, entries in self._record.rendered.items():
            entries[:-1] = []  # keeps the picture on screen as well
            self._record.earlier[stream] = len(entries)

    async def run(self) -> None:
        while True:
            await asyncio.sleep(INTERVAL)
            self._take(await self._look())

    async def end(self) -> None:
        look = await self._look()
        self._take(look)
        self._record.statistics = look.statistics

    def _take(self, look: Look) -> None:
        record = self._record
        record.feedbacks += fresh(record.feedbacks[-1].at if record.feedbacks else float("-inf"), look.feedbacks)
        for stream, entries in look.rendered.items():
            known = record.rendered.setdefault(stream, [])
            known += passes(record.gate, fresh(known[-1].at if known else float("-inf"), entries))
