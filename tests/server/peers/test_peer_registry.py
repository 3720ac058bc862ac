"""Peers run beside each other: how one ends is no matter of the others."""

import asyncio
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ShuttingDown
from lockstep.server.peers import peer_registry
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.settings import Settings
from lockstep.server.telemetry.metrics import Metrics
from tests.waiting import PATIENCE

ANN = Identity("observer", "Ann", "ann", 1e12)


class _Peer:
    """Runs until it is told to end, or to fail; `hangs`: it does not end until it is cancelled."""

    role, relay, thumbnail, name, identity = "observer", "", False, "Ann", ANN

    def __init__(self, id: str, *, hangs: bool = False, lost: Any = 0) -> None:
        self.id = id
        self.ended = ""
        self.was_cancelled = False
        self.transport = SimpleNamespace(lost=lost)
        self.host = SimpleNamespace(peer_joined=lambda peer: None)
        self._hangs = hangs
        self._end = asyncio.Event()
        self._fault: Exception | None = None

    def contained(self, stage: str) -> nullcontext[None]:
        return nullcontext()

    def end(self, why: str) -> None:
        self.ended = self.ended or why
        self._end.set()

    def fail(self, fault: Exception) -> None:
        self._fault = fault
        self.end("internal error")

    async def run(self) -> None:
        try:
            await self._end.wait()
            if self._hangs:
                await asyncio.Event().wait()
        except asyncio.CancelledError:
            self.was_cancelled = True
            raise
        if self._fault is not None:
            raise self._fault


def _registry() -> tuple[PeerRegistry, Metrics]:
    settings: Any = Settings()
    metrics = Metrics(process=False)
    return PeerRegistry(settings, metrics), metrics


async def test_a_peer_that_fails_as_it_runs_or_as_it_leaves_ends_alone_and_is_counted() -> None:
    registry, metrics = _registry()
    fails, leaves_badly, stays = _Peer("a"), _Peer("b", lost="not a number"), _Peer("c")
    async with asyncio.timeout(PATIENCE), registry.running():
        for peer in (fails, leaves_badly, stays):
            registry.admit(peer)  # type: ignore[arg-type]
        fails.fail(ZeroDivisionError())
        leaves_badly.end("deleted")
        while len(registry) > 1:  # noqa: ASYNC110
            await asyncio.sleep(0)
        assert [each.id for each in registry] == ["c"]
        assert not stays.was_cancelled
    assert (stays.ended, stays.was_cancelled, registry.ended) == ("shutdown", False, 3)
    assert metrics.registry.get_sample_value("lockstep_internal_errors_total", {"where": "peer"}) == 2


async def test_a_peer_that_does_not_end_is_cancelled_and_nobody_is_admitted_after_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(peer_registry, "CLOSE_TIMEOUT", 0.01)
    registry, _ = _registry()
    late: Any = _Peer("a", hangs=True)
    with pytest.raises(ShuttingDown):
        registry.admit(late)
    async with asyncio.timeout(PATIENCE), registry.running():
        registry.admit(late)
    assert late.was_cancelled
    assert len(registry) == 0
    with pytest.raises(ShuttingDown):
        registry.admit(late)
    with pytest.raises(ShuttingDown), registry.places.keep(ANN):
        raise AssertionError
