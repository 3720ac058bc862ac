import asyncio

import pytest

from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.client.control.driver import Driver
from lockstep.client.errors import CommandRefused, ConsoleLost
from lockstep.protocol.messages import Command, Rest
from tests.makers import feedback, refusal

SECONDS = 20


class Wire:
    """Keeps what was sent, and answers commands if it is told to."""

    def __init__(self, *, answering: bool) -> None:
        self.sent: list[Command | Rest] = []
        self.third = asyncio.Event()
        self.answering = answering
        self.driver = Driver(CommandSender(CommandGate("feedback", 4, 0.0), [0.0]), self.send)
        self.driver.feedback(feedback(1))
        self.driver.sender.readiness.ready = True

    def send(self, message: Command | Rest) -> None:
        self.sent.append(message)
        if len(self.sent) == 3:
            self.third.set()
        if self.answering and isinstance(message, Command):
            loop = asyncio.get_running_loop()
            loop.call_soon(self.driver.feedback, feedback(message.event))


async def test_a_command_returns_with_its_feedback() -> None:
    wire = Wire(answering=True)
    async with asyncio.timeout(SECONDS):
        assert [(await wire.driver.drive([1.0])).event for _ in range(3)] == [2, 3, 4]
    wire.driver.end(ConsoleLost("over"))


async def test_two_drives_at_once_end_with_an_event_each() -> None:
    wire = Wire(answering=True)
    async with asyncio.timeout(SECONDS):
        both = await asyncio.gather(wire.driver.drive([1.0]), wire.driver.drive([2.0]))
    assert [answer.event for answer in both] == [2, 3]
    wire.driver.end(ConsoleLost("over"))


async def test_repeats_leave_by_themselves() -> None:
    wire = Wire(answering=False)
    async with asyncio.timeout(SECONDS), asyncio.TaskGroup() as group:
        driving = group.create_task(wire.driver.drive([1.0]))
        await wire.third.wait()
        wire.driver.feedback(feedback(2))
    assert driving.result().event == 2
    assert {message.event for message in wire.sent[:3]} == {2}
    wire.driver.end(ConsoleLost("over"))


async def test_a_refusal_is_raised() -> None:
    wire = Wire(answering=False)
    async with asyncio.timeout(SECONDS), asyncio.TaskGroup() as group:
        driving = group.create_task(_reason(wire.driver))
        await asyncio.sleep(0)
        wire.driver.refusal(refusal(2, "stopped"))
    assert driving.result() == "stopped"
    wire.driver.end(ConsoleLost("over"))


async def _reason(driver: Driver) -> str:
    try:
        await driver.drive([1.0])
    except CommandRefused as refused:
        return refused.reason
    return ""


async def test_a_drive_that_was_given_up_leaves_nobody_waiting() -> None:
    wire = Wire(answering=False)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.01):
            await wire.driver.drive([1.0])
    wire.driver.feedback(feedback(2))
    wire.driver.end(ConsoleLost("over"))


async def test_rest_returns_when_it_is_proven() -> None:
    wire = Wire(answering=True)
    async with asyncio.timeout(SECONDS):
        await wire.driver.drive([1.0])
        await wire.driver.rest()
    assert Rest(event=2) in wire.sent
    assert wire.sent[-1] == Command(event=3, issue=1, values=[0.0])
    wire.driver.end(ConsoleLost("over"))


async def test_everybody_who_waits_is_told_of_the_loss() -> None:
    wire = Wire(answering=False)
    async with asyncio.timeout(SECONDS):
        waiting = [asyncio.ensure_future(wire.driver.drive([1.0])), asyncio.ensure_future(wire.driver.rest())]
        await asyncio.sleep(0)
        wire.driver.end(ConsoleLost("gone"))
        found = await asyncio.gather(*waiting, return_exceptions=True)
    assert isinstance(found[0], ConsoleLost | CommandRefused)
    assert isinstance(found[1], ConsoleLost)
    with pytest.raises(ConsoleLost, match="gone"):
        await wire.driver.drive([1.0])


async def test_the_picture_of_a_command_gives_the_delay() -> None:
    wire = Wire(answering=True)
    async with asyncio.timeout(SECONDS):
        await wire.driver.drive([1.0])
    wire.driver.shown(2)
    assert len(wire.driver.picture_delay.samples) == 1
    wire.driver.loss()
    wire.driver.end(ConsoleLost("over"))
