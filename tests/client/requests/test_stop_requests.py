"""Resets against a console that answers as it is told to."""

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from lockstep.client.errors import CommandRefused
from lockstep.client.requests import stop_requests
from lockstep.client.requests.exchange import Exchange
from lockstep.client.requests.stop_requests import StopRequests
from lockstep.client.session import Session
from lockstep.protocol.messages import Refusal, Reset, StopState

STALE = Refusal(event=0, reason="stale_reset", current=7, detail="a stop is on its way to the robot")


class Console:
    """Answers each reset with the next of `answers`."""

    def __init__(self, session: Session, answers: list[Refusal | StopState]) -> None:
        self.resets: list[Reset] = []
        self._session = session
        self._answers = answers

    def send(self, channel: str, message: Any) -> None:
        assert (channel, type(message)) == ("stop", Reset)
        self.resets.append(message)
        answer = self._answers.pop(0)
        if isinstance(answer, StopState):
            self._session.stop_shown(answer)
        else:
            self._session.refused(answer)


@pytest.fixture
def session(monkeypatch: pytest.MonkeyPatch) -> Session:
    monkeypatch.setattr(stop_requests, "RESET_AGAIN", 0.0)
    session = Session()
    session.stop_shown(StopState(stopped=True, number=3))
    return session


def _requests(session: Session, console: Console) -> StopRequests:
    async def until(condition: Callable[[], bool]) -> None:
        assert condition()

    driving: Any = SimpleNamespace()
    transport: Any = console
    return StopRequests(transport, session, driving, Exchange(transport, session, until), until)


async def test_a_reset_right_after_a_stop_waits_for_the_robots_answer_to_the_press(session: Session) -> None:
    console = Console(session, [STALE, STALE, StopState(stopped=False, number=3)])
    released = await _requests(session, console).reset("Ada", 3)
    assert not released.stopped
    assert [reset.number for reset in console.resets] == [3, 3, 3]


async def test_a_reset_of_a_stop_that_is_not_the_newest_is_refused_at_once(session: Session) -> None:
    session.stop_shown(StopState(stopped=True, number=4))
    console = Console(session, [STALE])
    with pytest.raises(CommandRefused, match="stale_reset"):
        await _requests(session, console).reset("Ada", 3)
    assert len(console.resets) == 1


async def test_a_stop_that_comes_while_a_reset_waits_is_not_released_by_it(session: Session) -> None:
    class Pressed(Console):
        def send(self, channel: str, message: Any) -> None:
            super().send(channel, message)
            if len(self.resets) == 2:
                session.stop_shown(StopState(stopped=True, number=4))

    console = Pressed(session, [STALE, STALE])
    with pytest.raises(CommandRefused, match="stale_reset"):
        await _requests(session, console).reset("Ada", 3)
    assert [reset.number for reset in console.resets] == [3, 3]


async def test_a_press_that_the_robot_never_answers_ends_the_reset(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_requests, "ANSWER_SECONDS", 0.05)
    console = Console(session, [STALE] * 100_000)
    async with asyncio.timeout(10):
        with pytest.raises(CommandRefused, match="stale_reset"):
            await _requests(session, console).reset("Ada", 3)
