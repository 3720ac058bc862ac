"""The pings and reports of a connection."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import cast

import pytest

from lockstep.client.console_url import parse_link
from lockstep.client.control.driving import Driving
from lockstep.client.heartbeat import EARLY_PINGS, Heartbeat
from lockstep.client.media.media_receiver import MediaReceiver
from lockstep.client.session import Session
from lockstep.client.transport.transport import ChannelName, Transport
from lockstep.protocol.console import ClientMessage, Report, RobotState
from lockstep.protocol.messages import Ping, Pong
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from tests.client.options import options

SECONDS = 20
ROBOT = RobotState(description=PlanarRobot().describe(), epoch="e", link="up")


class Wire:
    """A transport that keeps what was sent."""

    reliable = False

    def __init__(self) -> None:
        self.sent: asyncio.Queue[ClientMessage] = asyncio.Queue()
        self.why: asyncio.Queue[str] = asyncio.Queue()

    def send(self, channel: ChannelName, message: ClientMessage) -> None:
        assert channel == "control"
        self.sent.put_nowait(message)

    def lose(self, why: str) -> None:
        self.why.put_nowait(why)


class Beating:
    def __init__(self, silence_seconds: float) -> None:
        session = Session()
        self.wire = Wire()
        self.driving = Driving(options(parse_link("http://127.0.0.1:9/#token=x")), session, lambda message: None)
        self.heartbeat = Heartbeat(session, self.driving, silence_seconds)

    async def run(self) -> None:
        media = MediaReceiver({}, "event", self.driving.rendered, self.driving.heard)
        await self.heartbeat.run(cast(Transport, self.wire), media, relayed=False)


@asynccontextmanager
async def beating(silence_seconds: float = SECONDS) -> AsyncIterator[Beating]:
    beating = Beating(silence_seconds)
    async with asyncio.timeout(SECONDS), asyncio.TaskGroup() as tasks:
        running = tasks.create_task(beating.run())
        yield beating
        running.cancel()


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.client.heartbeat.EARLY_PING", 0.001)
    monkeypatch.setattr("lockstep.client.heartbeat.INTERVAL", 0.001)


async def test_pings_measure_the_path_before_the_first_report_and_nothing_is_sent_before_the_robot_is_known() -> None:
    async with beating() as beat:
        await asyncio.sleep(0)
        assert beat.wire.sent.empty()
        beat.driving.describe(ROBOT)
        for _ in range(EARLY_PINGS):
            assert isinstance(await beat.wire.sent.get(), Ping)
        assert isinstance(await beat.wire.sent.get(), Report)


async def test_a_pong_tells_the_round_trip_once() -> None:
    async with beating() as beat:
        beat.driving.describe(ROBOT)
        ping = await beat.wire.sent.get()
        assert isinstance(ping, Ping)
        assert beat.heartbeat.round_trip is None
        assert beat.heartbeat.pong(Pong(id=ping.id)) == beat.heartbeat.round_trip
        assert beat.heartbeat.pong(Pong(id=ping.id)) is None


async def test_a_silent_console_is_lost() -> None:
    async with beating(0.002) as beat:
        beat.driving.describe(ROBOT)
        assert await beat.wire.why.get() == "nothing was heard from the console for 0.002 s"
