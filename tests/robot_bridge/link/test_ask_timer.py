"""The timer that asks in time, with a session that says when."""

import asyncio
import time

from lockstep.protocol.messages import Command, LinkMessage
from lockstep.robot_bridge.link.ask_timer import AskTimer
from lockstep.robot_bridge.link.link_session import ClientSession
from tests.waiting import PATIENCE

FAR = 1e6  # s


class Session(ClientSession):
    """Asks when the test says so."""

    def __init__(self) -> None:
        super().__init__(time.monotonic(), "operator")
        self.due: float | None = None

    @property
    def asks_at(self) -> float | None:
        return self.due

    def sent(self, message: LinkMessage, now: float) -> None: ...


COMMAND = Command(event=2, issue=1, nonce=0, values=[])


async def test_it_ticks_when_an_answer_is_asked_for_and_again_when_that_is_said() -> None:
    session, ticked = Session(), asyncio.Queue[None]()

    def tick() -> None:
        session.due = time.monotonic() if ticked.empty() else None
        ticked.put_nowait(None)

    timer = AskTimer(session, tick)
    session.due = time.monotonic()
    timer.sent(COMMAND)
    async with asyncio.timeout(PATIENCE):
        await ticked.get()
        await ticked.get()


async def test_what_is_to_be_asked_for_sooner_does_not_wait_for_what_was_said_before() -> None:
    session, ticked = Session(), asyncio.Event()
    timer = AskTimer(session, ticked.set)
    session.due = time.monotonic() + FAR
    timer.sent(COMMAND)
    session.due = time.monotonic()
    timer.sent(COMMAND)
    async with asyncio.timeout(PATIENCE):
        await ticked.wait()
    timer.cancel()


async def test_an_answer_that_has_come_is_not_asked_for() -> None:
    session, ticked = Session(), asyncio.Event()
    timer = AskTimer(session, ticked.set)
    session.due = time.monotonic()
    timer.sent(COMMAND)
    session.due = None
    later = asyncio.Event()
    asyncio.get_running_loop().call_later(0.05, later.set)  # behind the timer, which was first
    await later.wait()
    assert not ticked.is_set()
