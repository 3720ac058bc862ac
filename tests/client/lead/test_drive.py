"""Driving by a leader: against a console of the tests that answers at once, or when the test lets it."""

import asyncio
from collections.abc import Callable

import pytest

from lockstep.client.control.clutch import Clutch
from lockstep.client.errors import CommandRefused
from lockstep.client.lead.drive import lead
from lockstep.client.lead.leader import Newest
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Feedback

PAN = Axis(name="pan.pos", label="Pan", unit="deg", minimum=-90, maximum=90, slew=60, brake=240, kind="goal", reach=30)
ROBOT = RobotDescription(name="arm", label="Arm", axes=(PAN,))


class Hand:
    words = "hold"

    def __init__(self) -> None:
        self.quit = asyncio.Event()
        self.is_held = False
        self._looked = asyncio.Event()

    def held(self, now: float) -> bool:
        self._looked.set()
        return self.is_held and not self.quit.is_set()

    async def until_looked_at(self, times: int = 2) -> None:
        """Wait until the hand was looked at several times more."""
        async with asyncio.timeout(10):
            for _ in range(times):
                self._looked.clear()
                await self._looked.wait()


class FakeConsole:
    """Has the calls of a console that `lead` makes, and notes them."""

    def __init__(self, clutch: Clutch) -> None:
        self.clutch = clutch
        self.said: list[object] = []
        self.changed = asyncio.Condition()
        self.go = asyncio.Event()
        self.go.set()
        self.refusal: CommandRefused | None = None
        self.place = 40.0
        self.event = 1
        self.at_rest = True

    async def note(self, what: object) -> None:
        async with self.changed:
            self.said.append(what)
            self.changed.notify_all()

    async def until(self, condition: Callable[[list[object]], bool]) -> None:
        async with asyncio.timeout(10), self.changed:
            await self.changed.wait_for(lambda: condition(self.said))

    def feedback(self) -> Feedback:
        return Feedback(
            event=self.event, issue=1, time=0.0, axes=[self.place], goals=[self.place], at_rest=self.at_rest
        )

    async def arm(self) -> Feedback:
        await self.note("arm")
        self.clutch.observe(self.feedback())
        return self.feedback()

    async def drive(self, values: dict[str, float]) -> Feedback:
        await self.note(values.get("pan.pos", "neutral"))
        await self.go.wait()
        if self.refusal is not None:
            raise self.refusal
        self.place = values.get("pan.pos", self.place)
        self.event += 1
        self.clutch.observe(self.feedback())
        return self.feedback()

    async def rest(self) -> None:
        await self.note("rest")


class Stage:
    def __init__(self) -> None:
        self.clutch = Clutch(ROBOT, {"pan.pos": 1.0})
        self.console = FakeConsole(self.clutch)
        self.hand = Hand()
        self.newest = Newest(["pan.pos"])
        self.words: list[str] = []
        self.move(0.0)

    def move(self, place: float) -> None:
        self.newest.put({"pan.pos": place}, float("inf"))  # never old

    def start(self) -> "asyncio.Task[None]":
        return asyncio.create_task(
            lead(self.console, self.clutch, self.newest, self.hand, self.words.append)  # type: ignore[arg-type]
        )

    async def end(self, driving: "asyncio.Task[None]") -> None:
        self.hand.quit.set()
        await asyncio.wait_for(driving, 10)


@pytest.fixture
async def stage() -> Stage:
    return Stage()


async def test_nothing_is_sent_while_nobody_holds(stage: Stage) -> None:
    driving = stage.start()
    stage.move(20.0)
    await stage.hand.until_looked_at(5)
    assert stage.console.said == []
    await stage.end(driving)


async def test_a_press_moves_nothing_and_then_the_robot_follows_the_leaders_own_motion(stage: Stage) -> None:
    stage.move(-70.0)
    driving = stage.start()
    await stage.hand.until_looked_at()
    stage.hand.is_held = True
    await stage.console.until(lambda said: len(said) > 2)
    assert stage.console.said[:2] == ["arm", 40.0]
    stage.move(-65.0)
    await stage.console.until(lambda said: 45.0 in said)
    await stage.end(driving)
    assert stage.console.said[-1] == "rest"


async def test_letting_go_rests_at_once_though_a_command_is_not_answered(stage: Stage) -> None:
    driving = stage.start()
    await stage.hand.until_looked_at()
    stage.console.go.clear()
    stage.hand.is_held = True
    await stage.console.until(lambda said: 40.0 in said)
    stage.hand.is_held = False
    await stage.console.until(lambda said: said[-1] == "rest")
    await stage.end(driving)


async def test_a_key_that_was_held_all_along_drives_only_after_a_new_press(stage: Stage) -> None:
    stage.hand.is_held = True
    driving = stage.start()
    await stage.hand.until_looked_at(5)
    assert stage.console.said == []
    await stage.end(driving)


async def test_after_a_refusal_it_takes_a_new_press(stage: Stage) -> None:
    stage.console.refusal = CommandRefused("stopped", "someone pressed STOP")
    driving = stage.start()
    await stage.hand.until_looked_at()
    stage.hand.is_held = True
    await stage.console.until(lambda said: said[-1:] == ["rest"])
    await stage.hand.until_looked_at(5)
    assert stage.console.said == ["arm", 40.0, "rest"]
    assert "press again" in stage.words[-1]
    await stage.end(driving)


async def test_a_leader_that_is_not_known_any_more_rests_the_robot(stage: Stage) -> None:
    driving = stage.start()
    await stage.hand.until_looked_at()
    stage.hand.is_held = True
    await stage.console.until(lambda said: 40.0 in said)
    stage.newest.put({}, float("inf"))
    await stage.console.until(lambda said: said[-1] == "rest")
    stage.move(0.0)
    await stage.hand.until_looked_at(5)
    assert stage.console.said[-1] == "rest"
    await stage.end(driving)


async def test_it_says_that_it_waits_for_the_robot_to_stand_still_and_drives_then(stage: Stage) -> None:
    stage.console.at_rest = False
    driving = stage.start()
    await stage.hand.until_looked_at()
    stage.hand.is_held = True
    await stage.console.until(lambda said: said.count("neutral") > 3)
    assert stage.words[1:] == ["waits until the robot stands still"]  # once
    stage.console.at_rest = True
    await stage.console.until(lambda said: 40.0 in said)
    assert stage.words[2:] == ["drives"]
    await stage.end(driving)


async def test_letting_go_while_it_waits_is_no_fault_of_the_leader(stage: Stage) -> None:
    stage.console.at_rest = False
    stage.console.go.clear()
    driving = stage.start()
    await stage.hand.until_looked_at()
    stage.hand.is_held = True
    await stage.console.until(lambda said: "neutral" in said)
    stage.hand.is_held = False
    await stage.console.until(lambda said: said[-1] == "rest")
    assert stage.words[1:] == ["waits until the robot stands still", "rests"]
    await stage.end(driving)
