"""What a robot that dials in vain writes to its log."""

import asyncio
import logging
from typing import Any, cast

import pytest

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
    dialing = asyncio.create_task(dialer.Dialer(ACCESS, cast(LinkServer, None)).run())
    async with asyncio.timeout(PATIENCE):
        await enough.wait()
    dialing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await dialing
    assert len({url.rpartition("/")[2] for url in tried}) == 2, "both links were tried"
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == len(set(told)) == 4, "two troubles of each link"
    assert sum("operator link" in text for text in told) == 2
