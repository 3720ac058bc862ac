"""When the next tick is prepared: at once, but after a feedback only when others had time to read it."""

import asyncio
from pathlib import Path

import pytest

from lockstep.robot_bridge.control.ticks.tick_alarm import TickAlarm
from lockstep.robot_bridge.control.ticks.work_ahead import WorkAhead
from lockstep.robot_bridge.link.sending.link_publisher import LinkPublisher
from tests.robot_bridge.bridge_helpers import DRIVE, PATIENCE, RecordingRobot, log_lines, operator, running_bridge


class Preparing(RecordingRobot):
    def __init__(self, order: list[str]) -> None:
        super().__init__()
        self.order = order

    def tick(self) -> None:
        super().tick()
        self.order.append("tick")

    def prepare(self) -> None:
        self.order.append("prepare")


async def test_what_reads_a_feedback_has_its_turn_before_the_next_tick_is_prepared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    order: list[str] = []
    publish = LinkPublisher.publish_feedback

    def published(self: LinkPublisher, feedback: object) -> None:
        order.append("feedback")
        asyncio.get_running_loop().call_soon(order.append, "others")
        publish(self, feedback)  # type: ignore[arg-type]

    monkeypatch.setattr(LinkPublisher, "publish_feedback", published)
    async with running_bridge(Preparing(order)) as bridge, operator(bridge) as driver:
        for _ in range(20):
            await driver.drive(DRIVE)
    assert order.count("feedback") > 20
    assert order.count("prepare") > 20
    told = [order[place + 1] for place, each in enumerate(order[:-1]) if each == "feedback"]
    assert set(told) == {"others"}
    without = [order[place + 1] for place, each in enumerate(order[:-1]) if each == "tick"]
    assert "prepare" in without, "a tick without a feedback is followed at once"


async def test_a_robot_that_no_command_hurries_is_prepared_after_every_tick() -> None:
    class OnTheBeat(Preparing):
        ticks_on_command = False

    order: list[str] = []
    async with running_bridge(OnTheBeat(order)) as bridge, operator(bridge) as driver:
        while len(order) < 20:
            await driver.drive(DRIVE)
    assert order[:20] == ["tick", "prepare"] * 10


async def test_where_the_work_ahead_takes_too_long_nothing_gives_way_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []

    async def noted_pause(self: TickAlarm, seconds: float) -> bool:
        pauses.append(seconds)
        return True

    monkeypatch.setattr(TickAlarm, "pause", noted_pause)
    monkeypatch.setattr(WorkAhead, "seconds", property(lambda self: 1.0, lambda self, seconds: None), raising=False)
    order: list[str] = []
    async with running_bridge(Preparing(order)) as bridge, operator(bridge) as driver:
        for _ in range(20):
            await driver.drive(DRIVE)
    assert not pauses
    assert "prepare" in order, "after a tick without a feedback"


async def test_a_bridge_that_closes_before_a_tick_is_prepared_did_not_lose_its_robot(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pauses = asyncio.Event()

    async def long_pause(self: TickAlarm, seconds: float) -> bool:
        pauses.set()
        await asyncio.Event().wait()
        return True

    robot = RecordingRobot()
    async with running_bridge(robot, event_log=tmp_path / "events.jsonl") as bridge, operator(bridge):
        monkeypatch.setattr(TickAlarm, "pause", long_pause)
        await asyncio.wait_for(pauses.wait(), PATIENCE)
    assert robot.calls == ["stop", "close"]
    assert not log_lines(tmp_path / "events.jsonl", "stop")
