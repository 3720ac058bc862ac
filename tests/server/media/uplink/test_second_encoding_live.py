"""A bridge that encodes twice, a console, an operator and an observer: who gets which, with true stamps.

The console's plan for the operator and what it knows of the uplink are set, so that a busy machine changes neither;
`test_second_share.py` and `test_uplink_estimator.py` test how it comes to know them.
"""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass, field
from typing import Any, cast

import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.protocol.messages import EncodeRequest
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.server.media.uplink import second_share
from lockstep.server.peers.peer import Peer
from tests.server.media.uplink.test_encoding_bridge_live import CAMERA, encoded, link, robot_that_encodes
from tests.server.rig import Rig
from tests.waiting import PATIENCE, eventually

NARROW, WIDE = 60_000, 800_000  # bit/s of a camera
TOLERANCE = 4  # events
SOME = 8  # pictures


@dataclass
class KnownUplink:
    """Stands for the estimator."""

    rate: float = 4e6
    is_limited: bool = False
    limited_at: float = float("-inf")

    def arrived(self, captured: float, now: float, size: int, camera: str | None = None) -> None:
        pass

    def decide(self, now: float) -> None:
        pass

    def waits(self, now: float) -> float | None:
        return 0.0

    def pictures_wait(self, now: float) -> float | None:
        return 0.0

    def carried(self) -> float:
        return self.rate

    def limited(self, now: float) -> bool:
        self.limited_at = now if self.is_limited else self.limited_at
        return self.is_limited

    def shown(self, now: float) -> float:
        return 0.0 if self.is_limited else self.rate


class Asking:
    """The console's requests to the real bridge, and what they depend on."""

    def __init__(self, rig: Rig) -> None:
        self.uplink = KnownUplink()
        self.requests: list[EncodeRequest] = []
        self._encoding = cast(Any, rig.dependencies.media.robot_encoding)
        self._encoding._uplink = self.uplink
        ask = self._encoding._ask

        def spy(request: EncodeRequest) -> bool:
            self.requests.append(request)
            return bool(ask(request))

        self._encoding.ask_by(spy)
        self.plan(NARROW)

    def plan(self, bps: int) -> None:
        """Set what the operator's path carries."""
        self._encoding._planned_bps = lambda stream: bps

    @property
    def is_second(self) -> bool:
        return bool(self.requests) and bool(self.requests[-1].second)

    @property
    def first_bitrate(self) -> int | None:
        """Of the operator's pictures, as it was asked for last."""
        return self.first_bitrates[-1] if self.requests else None

    @property
    def first_bitrates(self) -> list[int]:
        return [each.bitrate for request in self.requests for each in request.streams if each.stream == CAMERA]


@dataclass
class Seen:
    """The pictures that a client has shown."""

    stamps: list[int] = field(default_factory=list)
    widths: list[int] = field(default_factory=list)

    async def watch(self, console: Console) -> None:
        async with aclosing(console.pictures(CAMERA)) as pictures:
            async for picture in pictures:
                assert picture.stamp is not None
                assert picture.gap is not None
                assert abs(picture.gap) <= TOLERANCE
                assert read_event_strip(picture.frame.to_ndarray(format="gray")) == picture.stamp
                self.stamps.append(picture.stamp)
                self.widths.append(picture.frame.width)


def narrower(mine: Seen, other: Seen, count: int) -> bool:
    """True if the newest pictures of `mine` are smaller than those of `other`."""
    if min(len(mine.widths), len(other.widths)) < count:
        return False
    return max(mine.widths[-count:]) < min(other.widths[-count:])


@asynccontextmanager
async def watching(*pairs: tuple[Console, Seen]) -> AsyncIterator[None]:
    tasks = [asyncio.ensure_future(seen.watch(console)) for console, seen in pairs]
    try:
        yield
        assert not [task for task in tasks if task.done()], [task.exception() for task in tasks if task.done()]
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def drive_until(console: Console, condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not condition():
            await drive_on(console, [0.3, 0.0, 0.2])


def due_all(rig: Rig) -> None:
    """Let observers be due all pictures: their paths carry them."""
    for peer in rig.webrtc_peers:
        for delivery in media_of(peer):
            if not delivery.target.priority:
                delivery.target.tier = "high"


def media_of(peer: Peer) -> list[Any]:
    return list(cast(Any, peer).media.deliveries)


async def test_an_observer_gets_more_than_a_narrow_operator_and_costs_the_first_encoding_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(second_share, "WANTED_SECONDS", 0.2)
    monkeypatch.setattr(second_share, "SILENCE", 1000.0)  # a busy machine is silent too
    async with (
        robot_that_encodes(media={"quality": False, "second_encoding": True}) as (_, rig),
        Console(link(rig), codec="H264", tolerance=TOLERANCE) as operator,
        Console(
            f"{rig.url}/#token={rig.access.issue('observer', 'Ben')}", codec="H264", name="Ben", tolerance=TOLERANCE
        ) as observer,
    ):
        asking, mine, others = Asking(rig), Seen(), Seen()
        await operator.take_seat()
        await eventually(lambda: asking.first_bitrate == NARROW)
        asking.requests.clear()  # those of before
        due_all(rig)
        async with watching((operator, mine), (observer, others)):
            await drive_until(operator, lambda: asking.is_second and narrower(mine, others, SOME))
            assert set(asking.first_bitrates) == {NARROW}
            # The operator's path is wide again: one encoding serves both.
            asking.plan(WIDE)
            await drive_until(operator, lambda: not asking.is_second and others.widths[-1] == mine.widths[-1])
            asking.plan(NARROW)
            await drive_until(operator, lambda: asking.is_second and narrower(mine, others, SOME))
            asking.uplink.is_limited = True
            shown = len(mine.stamps)
            await drive_until(
                operator,
                lambda: (
                    not asking.is_second
                    and set(others.widths[-SOME:]) == set(mine.widths[-SOME:])
                    and len(mine.stamps) > shown + SOME
                ),
            )
        for seen in (mine, others):
            assert seen.stamps == sorted(seen.stamps)
        assert set(asking.first_bitrates) == {NARROW, WIDE}
        assert encoded(rig, "H264") < len(mine.stamps)
