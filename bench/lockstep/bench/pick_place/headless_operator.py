"""Drives by the headless client: goals of the tool, a leader arm through the clutch, a policy's joint positions."""

from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from lockstep.bench.pick_place.hands import LEADER_SCALES, LeaderHand, PolicyHand
from lockstep.bench.pick_place.operate import operate
from lockstep.bench.pick_place.operator import HandName, Pictures
from lockstep.bench.pick_place.script import Hand, PickAndPlace, ToolHand
from lockstep.client import CommandRefused, Console
from lockstep.protocol.description import RobotDescription

__all__ = ["HeadlessOperator", "headless_operator"]

CONNECT_SECONDS: Final = 60.0  # through a bad network, with a busy machine
SILENCE_SECONDS: Final = 15.0


class HeadlessOperator:
    """One console for all blocks."""

    longest = 60.0
    longest_block = 240.0

    def __init__(self, console: Console, name: HandName) -> None:
        self._console = console
        self._name = name

    @property
    def description(self) -> RobotDescription:
        return self._console.description

    def hand(self) -> Hand:
        console = self._console
        if self._name == "leader":
            return LeaderHand(console.description, console.clutch(LEADER_SCALES))
        return PolicyHand(console.description) if self._name == "policy" else ToolHand(console.description)

    async def reset_scene(self) -> None:
        await self._console.act("reset_scene")

    async def until_in_bowl(self, count: int) -> None:
        async for _ in self._console.feedbacks():
            if any(item.name == "bowl" and item.value == count for item in self._console.status):
                return

    async def operate(self, task: PickAndPlace, held_up: Counter[str]) -> None:
        """As a person does, ask for the seat anew where the console has freed it because the client was held up."""
        while True:
            try:
                await operate(self._console, task, held_up, task.think)
            except CommandRefused as refused:
                if refused.reason != "no_seat":
                    raise
                held_up[refused.reason] += 1
                await self._console.take_seat()
            else:
                return

    async def pictures(self) -> Pictures:
        streams = self._console.stats().streams
        return Pictures(sum(each.rendered for each in streams), sum(each.violations for each in streams))


@asynccontextmanager
async def headless_operator(link: str, name: HandName, *, pictures: bool) -> AsyncIterator[HeadlessOperator]:
    """Connect, and take the seat. `pictures`: of both cameras, shown by the gate."""
    async with Console(
        link,
        video=2 if pictures else False,
        audio=False,
        decode=pictures,
        name=name,
        connect_seconds=CONNECT_SECONDS,
        silence_seconds=SILENCE_SECONDS,
    ) as console:
        await console.take_seat()
        yield HeadlessOperator(console, name)
