"""A registry as text, made without holding up anything."""

import asyncio
from collections.abc import Callable, Iterable
from copy import copy

from prometheus_client import CollectorRegistry, Metric, generate_latest
from prometheus_client.registry import Collector

__all__ = ["Exposition"]


class Exposition:
    """What /metrics answers: one family in each turn of the loop, and once for all who ask meanwhile.

    Anybody may ask, and all families together would take longer than an operator's message may wait.
    """

    def __init__(self, registry: CollectorRegistry) -> None:
        self._registry = registry
        self._lock = asyncio.Lock()
        self._begun = 0
        self._text = b""

    async def text(self, bring_up_to_date: Callable[[], None] = lambda: None) -> bytes:
        """Exposition format, version 0.0.4; nothing in it is older than the question.

        `bring_up_to_date`: called before what is counted is read.
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
    """One family where a registry is expected, without the times at which its counters were made.

    They would double the page, and nothing here is made later than the console.
    """

    def __init__(self, family: Metric) -> None:
        self._family = copy(family)
        self._family.samples = [sample for sample in family.samples if not sample.name.endswith("_created")]

    def collect(self) -> Iterable[Metric]:
        return (self._family,)
