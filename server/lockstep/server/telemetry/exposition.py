"""Renders a registry as text without blocking the event loop."""

import asyncio
from collections.abc import Callable, Iterable
from copy import copy

from prometheus_client import CollectorRegistry, Metric, generate_latest
from prometheus_client.registry import Collector

__all__ = ["Exposition"]


class Exposition:
    """Renders /metrics: one family in each iteration of the loop, and once for all requests that come meanwhile.

    Anybody may ask, and all families together would take longer than an operator's message may wait.
    """

    def __init__(self, registry: CollectorRegistry) -> None:
        self._registry = registry
        self._lock = asyncio.Lock()
        self._begun = 0
        self._text = b""

    async def text(self, bring_up_to_date: Callable[[], None] = lambda: None) -> bytes:
        """Return the exposition format, version 0.0.4; nothing in it is older than the call.

        `bring_up_to_date`: called before the metrics are read.
        """
        begun_before = self._begun
        async with self._lock:
            if self._begun == begun_before or self._text == b"":
                self._begun += 1
                self._text = b""
                bring_up_to_date()
                self._text = await self._made()
            return self._text

    async def _made(self) -> bytes:
        parts: list[bytes] = []
        for family in self._registry.collect():
            parts.append(generate_latest(_Only(family)))
            await asyncio.sleep(0)
        return b"".join(parts)


class _Only(Collector):
    """A registry of one family, without the times at which its counters were made.

    They would double the page, and all counters are as old as the console.
    """

    def __init__(self, family: Metric) -> None:
        self._family = copy(family)
        self._family.samples = [sample for sample in family.samples if not sample.name.endswith("_created")]

    def collect(self) -> Iterable[Metric]:
        return (self._family,)
