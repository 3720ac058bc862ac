"""A robot link is kept until its keeper is cancelled."""

import asyncio
from pathlib import Path
from typing import Any, Self

import pytest

from lockstep.protocol.messages import LinkRole
from lockstep.server.robot.credentials import RobotLinkCredentials
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.robot.reconnecting_link import ReconnectingRobotLink
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.state_dir import StateDir
from tests.waiting import eventually


class Sink:
    def __init__(self) -> None:
        self.failed: list[Exception] = []

    def link_opened(self, *_: Any) -> None:
        raise AssertionError("it never opens")

    def link_received(self, *_: Any) -> None:
        raise AssertionError("it never opens")

    def link_closed(self, role: LinkRole, detail: str) -> None:
        pass

    def link_failed(self, role: LinkRole, error: Exception) -> None:
        self.failed.append(error)


class FailsAsItEnds:
    """A link whose clean-up raises, the first time."""

    tried: "list[FailsAsItEnds]"
    waiting: asyncio.Event

    def __init__(self, *_: Any, **__: Any) -> None:
        self.tried.append(self)

    async def __aenter__(self) -> Self:
        self.waiting.set()
        try:
            await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            if len(self.tried) > 1:
                raise
            raise RuntimeError("the handler is closed") from None
        return self

    async def __aexit__(self, *_: object) -> None:
        pass


class Line:
    address = "a robot"
    is_closed = False

    def carry(self, link: asyncio.Protocol) -> None:
        raise AssertionError("it carries a link without a key")

    def close(self) -> None:
        self.is_closed = True


async def test_a_line_that_comes_while_no_robot_is_paired_gets_no_link(tmp_path: Path) -> None:
    """With no key a link would ask for no proof."""
    dial_in = DialIn(StateDir(tmp_path), None, lambda: None)
    sink, line, later = Sink(), Line(), Line()
    keeper = ReconnectingRobotLink(
        "", 0, "operator", sink, Backoff(0.01, 0.01), RobotLinkCredentials(), dial_in=dial_in
    )
    running = asyncio.ensure_future(keeper.run())
    dial_in.arrived("operator", line)
    await eventually(lambda: line.is_closed)
    dial_in.arrived("operator", later)
    await eventually(lambda: later.is_closed)
    running.cancel()
    await asyncio.wait([running])
    assert not sink.failed


async def test_a_fault_in_ending_does_not_hide_that_it_was_cancelled(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    FailsAsItEnds.tried, FailsAsItEnds.waiting = [], asyncio.Event()
    monkeypatch.setattr("lockstep.server.robot.reconnecting_link.RobotLink", FailsAsItEnds)
    sink = Sink()
    keeper = ReconnectingRobotLink("127.0.0.1", 1, "operator", sink, Backoff(0.01, 0.01), RobotLinkCredentials())
    running = asyncio.ensure_future(keeper.run())
    await FailsAsItEnds.waiting.wait()
    FailsAsItEnds.waiting.clear()
    running.cancel()
    again = asyncio.ensure_future(FailsAsItEnds.waiting.wait())
    await asyncio.wait([running, again], return_when=asyncio.FIRST_COMPLETED)
    again.cancel()
    running.cancel()
    await asyncio.wait([running])
    assert len(FailsAsItEnds.tried) == 1, "it connected again"
    assert not sink.failed
    assert "the handler is closed" in capsys.readouterr().out
