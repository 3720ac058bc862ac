"""What follows a new seat: the first feedback is waited for, and answered by a neutral command."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any, Literal

import pytest

from lockstep.client.console_url import parse_link
from lockstep.client.control.driving import Driving
from lockstep.client.errors import ConsoleLost, NoFeedback
from lockstep.client.heartbeat import Heartbeat
from lockstep.client.media.media_receiver import MediaReceiver
from lockstep.client.message_dispatcher import MessageDispatcher
from lockstep.client.requests import seat_requests
from lockstep.client.requests.exchange import Exchange
from lockstep.client.requests.seat_requests import SeatRequests
from lockstep.client.session import Session
from lockstep.protocol.console import RobotState, Seat, Welcome, encode_console_message
from lockstep.protocol.messages import Command, Rest
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from tests.client.options import SECONDS, options
from tests.makers import feedback


class Client:
    """A connection that holds the seat of a robot of which no feedback has come."""

    def __init__(self) -> None:
        self.sent: list[Command | Rest] = []
        self._session = Session()
        self.driving = Driving(options(parse_link("http://127.0.0.1:9/#token=x")), self._session, self._send)
        media = MediaReceiver({}, "event", self.driving.rendered, self.driving.heard)
        self.messages = MessageDispatcher(
            self._session, self.driving, media, Heartbeat(self._session, self.driving, SECONDS)
        )
        transport: Any = None  # only messages arrive here
        exchange = Exchange(transport, self._session, self.messages.until)
        self.seat = SeatRequests(transport, self._session, self.driving, exchange, self.messages.until)
        self.robot("up")
        for message in (Welcome(peer="ann", role="operator", name="Ann", streams=[]), Seat(holder="ann")):
            self._session.hear(message)

    def _send(self, message: Command | Rest) -> None:
        self.sent.append(message)
        asyncio.get_running_loop().call_soon(self.fed, message.event)

    def robot(self, link: Literal["up", "down"]) -> None:
        state = RobotState(description=PlanarRobot().describe(), epoch="e", link=link)
        self.messages.received(encode_console_message(state))

    def fed(self, event: int, *, stopped: bool = False) -> None:
        self.messages.received(encode_console_message(feedback(event, axes=[0.0, 0.0, 0.0], stopped=stopped)))


@pytest.fixture
async def client() -> AsyncIterator[Client]:
    client = Client()
    async with asyncio.timeout(SECONDS):
        yield client
    client.driving.end(ConsoleLost("over"))


async def _waiting(client: Client, tasks: asyncio.TaskGroup) -> asyncio.Task[None]:
    arming = tasks.create_task(client.seat.arm_if_possible())
    await asyncio.sleep(0)
    assert not arming.done()
    assert client.sent == []
    return arming


async def test_arming_waits_for_the_first_feedback(client: Client) -> None:
    async with asyncio.TaskGroup() as tasks:
        await _waiting(client, tasks)
        client.fed(1)
    assert [(type(each), each.event) for each in client.sent] == [(Command, 2)]
    assert client.driving.driver.sender.readiness.ready


async def test_without_feedback_arming_fails_by_name(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seat_requests, "FEEDBACK_SECONDS", 0.01)
    with pytest.raises(NoFeedback, match=r"within 0\.01 s"):
        await client.seat.arm_if_possible()
    assert client.sent == []


async def test_a_robot_that_goes_away_meanwhile_is_not_waited_for(client: Client) -> None:
    async with asyncio.TaskGroup() as tasks:
        await _waiting(client, tasks)
        client.robot("down")
    assert client.sent == []


async def test_a_stopped_robot_is_not_armed(client: Client) -> None:
    async with asyncio.TaskGroup() as tasks:
        await _waiting(client, tasks)
        client.fed(1, stopped=True)
    assert client.sent == []


async def test_the_end_of_the_connection_ends_the_wait(client: Client) -> None:
    async with asyncio.TaskGroup() as tasks:
        arming = tasks.create_task(_lost(client))
        await asyncio.sleep(0)
        client.messages.end(ConsoleLost("gone"))
    assert arming.result() == "gone"


async def _lost(client: Client) -> str:
    with pytest.raises(ConsoleLost) as lost:
        await client.seat.arm_if_possible()
    return str(lost.value)
