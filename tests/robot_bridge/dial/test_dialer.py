"""What a robot that dials writes to its log, in vain and when it waits for another connection's end."""

import asyncio
import logging
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest
from websockets.datastructures import Headers

from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.dial import dialer
from lockstep.robot_bridge.dial.console_access import ConsoleAccess
from lockstep.robot_bridge.dial.console_address import ConsoleAddress
from lockstep.robot_bridge.dial.console_key import ConsoleKey
from lockstep.robot_bridge.dial.redial_times import RedialTimes
from lockstep.robot_bridge.errors import ConsoleUnreachable
from lockstep.robot_bridge.link.link_server import LinkServer
from tests.waiting import PATIENCE

ACCESS = ConsoleAccess(ConsoleAddress.parse("ws://127.0.0.1:9"), ConsoleKey(LinkSecret("k" * 32)))


async def _dial_until(enough: asyncio.Event, links: object) -> None:
    dialing = asyncio.create_task(dialer.Dialer(ACCESS, cast(LinkServer, links)).run())
    async with asyncio.timeout(PATIENCE):
        await enough.wait()
    dialing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await dialing


async def test_each_link_tells_a_trouble_once_however_often_it_is_tried(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    tried: list[str] = []
    enough = asyncio.Event()

    async def refused(url: str, *_: Any, **__: Any) -> Any:
        tried.append(url)
        if len(tried) == 20:
            enough.set()
        if len(tried) % 4 > 1:
            raise ConsoleUnreachable(f"nothing answers at {url} any more")
        raise ConsoleUnreachable(f"nothing answers at {url}")

    monkeypatch.setattr(dialer, "open_connection", refused)
    monkeypatch.setattr(RedialTimes, "wait", lambda *_, **__: 0.0)
    caplog.set_level(logging.INFO, dialer.__name__)
    await _dial_until(enough, None)
    assert len({url.rpartition("/")[2] for url in tried}) == 2, "both links were tried"
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == len(set(told)) == 4, "two troubles of each link"
    assert sum("operator link" in text for text in told) == 2


class Connection:
    """What a console's answer has made, as a dialler sees it. It ends at once unless it `lasts`."""

    def __init__(self, headers: Sequence[tuple[str, str]], admitted: bool, lasts: bool) -> None:
        self.response = SimpleNamespace(headers=Headers(headers))
        self.transport = SimpleNamespace(abort=lambda: None)
        self.ended = asyncio.Event()
        self.lasts = lasts
        self._admitted = admitted
        self.pings = 0

    async def ping(self) -> None:
        self.pings += 1

    def carry(self, link: Any) -> None:
        if self._admitted:
            link.admitted.set()
        if not self.lasts:
            asyncio.get_running_loop().call_later(0.01, self.ended.set)


async def told(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, answer: Callable[[int], Connection]
) -> list[str]:
    """What the operator link's tries write to the log, until the last one that lasts. `answer`: of each try, from 0."""
    tried = 0
    lasts = asyncio.Event()

    async def opened(url: str, *_: Any, **__: Any) -> Connection:
        nonlocal tried
        if url.endswith("media"):
            await asyncio.Event().wait()
        tried += 1
        connection = answer(tried - 1)
        if connection.lasts:
            asyncio.get_running_loop().call_later(0.05, lasts.set)
        return connection

    monkeypatch.setattr(dialer, "open_connection", opened)
    monkeypatch.setattr(RedialTimes, "wait", lambda *_, **__: 0.0)
    caplog.set_level(logging.INFO, dialer.__name__)
    links = SimpleNamespace(dialled_link=lambda key: SimpleNamespace(admitted=asyncio.Event()))
    await _dial_until(lasts, links)
    return [record.getMessage() for record in caplog.records]


REACHED = "the operator link has reached the console at ws://127.0.0.1:9"
WAITS = ("Lockstep-Link", "waits")


@pytest.mark.parametrize(
    "headers",
    [[], [("Lockstep-Link", "")], [("Lockstep-Link", "waits longer")], [("Lockstep-Link", "Waits")], [WAITS, WAITS]],
)
async def test_an_answer_without_the_header_or_with_another_value_has_reached_the_console(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, headers: list[tuple[str, str]]
) -> None:
    """An older console sends none; and what stands between may send anything."""
    monkeypatch.setattr(dialer, "OWN_LINK_ENDS", 0.0)
    assert await told(monkeypatch, caplog, lambda n: Connection(headers, False, n == 5)) == [REACHED]


@pytest.mark.parametrize(("admitted", "pings"), [(False, 4), (True, 0)])
async def test_a_link_pings_a_few_times_behind_its_handshake_until_it_is_admitted(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, admitted: bool, pings: int
) -> None:
    """So TCP learns within a round trip that a message of the handshake was lost."""
    monkeypatch.setattr(dialer, "PING_SECONDS", 0.0)
    monkeypatch.setattr(dialer, "MOST_PINGS", 4)
    connection = Connection([], admitted, True)
    await told(monkeypatch, caplog, lambda _: connection)
    assert connection.pings == pings


async def test_a_link_that_waits_tells_it_once_however_often_it_dials_and_then_that_it_is_there(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(dialer, "OWN_LINK_ENDS", 0.03)  # longer than a try
    said = await told(monkeypatch, caplog, lambda n: Connection([WAITS], n == 20, n == 20))
    assert said == [f"the operator link waits: {dialer.TAKEN}", REACHED]


async def test_a_link_whose_own_predecessor_ends_soon_tells_nothing_of_a_second_robot(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert await told(monkeypatch, caplog, lambda n: Connection([WAITS], n == 5, n == 5)) == [REACHED]


async def test_a_trouble_is_told_again_after_the_link_was_there(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def answer(n: int) -> Connection:
        if n % 3:
            raise ConsoleUnreachable("nothing answers")
        return Connection([], True, n == 6)

    trouble = "the operator link does not reach the console, trying on: console_unreachable: nothing answers"
    assert await told(monkeypatch, caplog, answer) == [REACHED, trouble, REACHED, trouble, REACHED]
