"""The whole bridge over real TCP."""

import asyncio
import itertools
import logging
import signal
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import ClassVar, cast

import msgspec
import pytest

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import LinkLost
from lockstep.protocol.messages import EventNotice, Feedback, Goodbye, Media, Rest, Stop
from lockstep.protocol.serial import FIRST_EVENT, MAX_EVENT, event_gap
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import DescriptionError, ListenError, RobotFailed
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Stamper
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import DRIVE, NEUTRAL, RecordingRobot, log_lines, operator, running_bridge

MARGIN = 0.05  # s between the bridge's reading of the clock and the test's, on a busy machine


def speed(robot: RecordingRobot) -> float:
    return abs(robot.state.vx)


async def test_commands_move_the_robot_and_each_feedback_belongs_to_its_command() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        assert driver.feedback.event == 2, "that of the neutral command"
        events = [(await driver.drive()).event for _ in range(30)]
        assert all(later > event for event, later in pairwise(events))
        assert driver.feedback.joints[0] > 0.0
        assert driver.feedback.axes[0] > 0.1
        assert bridge.counters.executed == events[-1] - 1 >= 31  # more where a busy machine held up the robot
    assert robot.calls == ["stop", "close"]


async def test_events_go_on_over_the_wrap() -> None:
    async with running_bridge(first_event=MAX_EVENT - 2) as bridge, operator(bridge) as driver:
        events = [(await driver.drive()).event for _ in range(4)]
    assert all(event_gap(later, earlier) > 0 for earlier, later in pairwise(events))
    assert 3 <= events[-1] < 100, "3, and more where a busy machine held up the robot"


async def test_without_commands_the_robot_is_at_rest_within_hold_while_the_link_lives(tmp_path: Path) -> None:
    robot, log = RecordingRobot(), tmp_path / "events.jsonl"
    async with running_bridge(robot, event_log=log) as bridge, operator(bridge) as driver:
        for _ in range(30):
            await driver.drive()
        assert speed(robot) > 0.1
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
        hold = bridge.description.hold
    executed = log_lines(log, "executed")[-1]["time"]
    assert isinstance(executed, float)
    assert all(values == NEUTRAL for when, values in robot.applied if when >= executed + hold + MARGIN)
    assert any(values != NEUTRAL for when, values in robot.applied if when >= executed)
    driven, at_rest = log_lines(log, "driven"), log_lines(log, "at_rest")
    assert len(driven) == len(at_rest) >= 1  # more than once where a busy machine held the robot up
    assert cast(float, driven[-1]["time"]) < executed < cast(float, at_rest[-1]["time"])


async def test_when_the_operator_link_ends_the_robot_comes_to_rest_long_before_hold() -> None:
    class PatientRobot(RecordingRobot):
        def describe(self) -> RobotDescription:
            return msgspec.structs.replace(super().describe(), hold=5.0)

    robot = PatientRobot()
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            for _ in range(20):
                await driver.drive()
            assert speed(robot) > 0.1
        ended = asyncio.get_running_loop().time()
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
        assert asyncio.get_running_loop().time() - ended < 4.0


DRIVE_FOREVER = """
import asyncio, sys
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.protocol.messages import Command, Feedback

async def main():
    async with RobotLink("127.0.0.1", int(sys.argv[1]), "operator") as link:
        async for message in link:
            if isinstance(message, Feedback):
                values = [0.0 if message.neutral_needed else 0.4, 0.0, 0.0]
                link.send(Command(event=message.event + 1, issue=message.issue, values=values, nonce=message.nonce))

asyncio.run(main())
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
async def test_a_client_process_that_dies_leaves_the_robot_at_rest_within_hold(
    how: signal.Signals, tmp_path: Path
) -> None:
    robot, log = RecordingRobot(), tmp_path / "events.jsonl"
    async with running_bridge(robot, event_log=log) as bridge:
        port = str(bridge.address[1])
        client = await asyncio.create_subprocess_exec(sys.executable, "-c", DRIVE_FOREVER, port)
        try:
            await robot.until(lambda: speed(robot) > 0.3, "the client drives")
            client.send_signal(how)
            await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
            await robot.until(lambda: bridge.links == 0, "the link is dropped")
            rested = len(robot.applied)
            await robot.until(lambda: len(robot.applied) > rested + 20, "more ticks")
            assert all(values == NEUTRAL for _, values in robot.applied[rested:])
        finally:
            if client.returncode is None:
                client.kill()
            await client.wait()
        hold = bridge.description.hold
    executed = log_lines(log, "executed")[-1]["time"]
    assert isinstance(executed, float)
    assert all(values == NEUTRAL for when, values in robot.applied if when >= executed + hold + MARGIN)


async def test_rest_brings_the_axes_to_rest_and_voids_the_command_in_flight() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        for _ in range(20):
            await driver.drive()
        command = driver.command()
        driver.link.send(Rest(event=command.event))
        refusal = await driver.refused(command)
        assert refusal.reason == "rested"
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
        await driver.drive(NEUTRAL)
        await driver.drive()
        assert speed(robot) > 0


async def test_stop_latches_and_reset_moves_nothing() -> None:
    robot = RecordingRobot()
    async with (
        running_bridge(robot) as bridge,
        operator(bridge) as driver,
        RobotLink(*bridge.address, "events") as watcher,
    ):
        for _ in range(10):
            await driver.drive()
        watcher.send(Stop(by="Ada", reason="smoke"))
        await driver.heard(lambda feedback: feedback.stop.stopped)
        assert (driver.feedback.stop.by, driver.feedback.stop.reason) == ("Ada", "smoke")
        assert (await driver.refused(driver.command())).reason == "stopped"
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "at rest")
        assert await driver.reset(by="Ada") == driver.feedback.stop.number
        assert robot.applied[-1][1] == NEUTRAL
        assert (await driver.refused(driver.command())).reason == "not_neutral"
        await driver.arm()
        await driver.drive()
        assert speed(robot) > 0
    assert robot.calls == ["stop", "reset", "stop", "close"]


async def test_a_repeat_of_the_current_event_gets_its_feedback_again_and_executes_nothing() -> None:
    async with running_bridge() as bridge, operator(bridge) as driver:
        command = driver.command()
        first = await driver.drive()
        driver.link.send(command)
        assert await driver.next(Feedback) == first
        assert bridge.counters.executed == 2


async def test_an_idle_bridge_issues_the_same_event_again_and_tells_event_links() -> None:
    async with (
        running_bridge() as bridge,
        operator(bridge) as driver,
        RobotLink(*bridge.address, "events") as watcher,
    ):
        before = driver.feedback
        await driver.heard(lambda feedback: feedback.issue >= before.issue + 3)
        assert driver.feedback.event == 2
        notice = await anext(watcher)
        assert isinstance(notice, EventNotice)
        assert notice.event == 2
        with pytest.raises(LinkLost, match="description"):
            watcher_description(watcher)


def watcher_description(link: RobotLink) -> RobotDescription:
    if link.hello.description is None:
        raise LinkLost("no description")
    return link.hello.description


async def test_media_are_stamped_with_the_event_that_held(tmp_path: Path) -> None:
    log = tmp_path / "events.jsonl"
    received: dict[str, Media] = {}
    async with (
        running_bridge(RecordingRobot(media=True), event_log=log) as bridge,
        operator(bridge) as driver,
        RobotLink(*bridge.address, "media") as watcher,
    ):
        async with asyncio.timeout(20):
            async for medium in watcher:
                assert isinstance(medium, Media)
                await driver.drive()
                assert medium.stamp <= bridge.event
                received[medium.stream] = medium
                if len(received) == 3 and bridge.event > 20:
                    break
    captured = {(line["stream"], line["captured"]): line["event"] for line in log_lines(log, "media")}
    issued = [(float(str(line["time"])), int(str(line["event"]))) for line in log_lines(log, "feedback")]
    for medium in received.values():
        assert captured[medium.stream, medium.time] == medium.stamp
        assert medium.stamp == max(event for when, event in issued if when <= medium.time)


async def test_what_is_captured_before_a_feedback_is_measured_belongs_to_the_event_before(tmp_path: Path) -> None:
    """A camera of another process has a clock and no turn: it may capture between the tick and its feedback."""
    log = tmp_path / "events.jsonl"

    class Keeping(MediaSource):
        async def run(self, stamp: Stamper, emit: object) -> None:
            self.stamp = stamp

    class MeasuredRobot(RecordingRobot):
        source = Keeping()
        measured_at: ClassVar[list[float]] = []

        def measure(self) -> Measurement:
            self.measured_at.append(time.monotonic())
            return super().measure()

        def sources(self) -> list[MediaSource]:
            return [self.source]

    robot = MeasuredRobot()
    async with running_bridge(robot, event_log=log) as bridge, operator(bridge) as driver:
        for _ in range(10):
            await driver.drive()
    newest = FIRST_EVENT
    for line, measured_at in zip(log_lines(log, "feedback"), robot.measured_at, strict=True):
        event = int(str(line["event"]))
        if event != newest:
            shown = robot.source.stamp.at(measured_at)
            assert shown is not None
            assert shown.event == newest
            assert float(str(line["time"])) > measured_at
        newest = event
    assert newest >= FIRST_EVENT + 10


async def test_the_counters_are_logged_at_intervals(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "lockstep.robot_bridge.bridge")
    robot = RecordingRobot()
    async with Bridge(robot, BridgeSettings(port=0, log_interval=0.01)) as bridge, operator(bridge) as driver:
        await driver.refused(driver.command([0.0]))
        await robot.until(lambda: "'wrong_size': 1" in caplog.text, "a line with the counters")


async def test_closing_the_bridge_says_so_and_leaves_the_robot_at_rest() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            for _ in range(20):
                await driver.drive()
            assert speed(robot) > 0.1
            await bridge.close()
            with pytest.raises(LinkLost, match="closing"):
                await driver.next(Goodbye)
        await bridge.close()
    assert robot.applied[-1][1] == NEUTRAL
    assert robot.calls == ["stop", "close"]


async def test_a_robot_that_raises_ends_the_bridge_with_its_reason() -> None:
    class BrokenRobot(RecordingRobot):
        def stop(self) -> None:
            super().stop()
            raise OSError("the relay does not answer")

    robot = BrokenRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        driver.link.send(Stop())
        with pytest.raises(RobotFailed, match="the relay does not answer"):
            await bridge.wait()
        with pytest.raises(LinkLost):
            await driver.next(Goodbye)


async def test_a_media_source_that_breaks_is_a_fault_and_not_the_end() -> None:
    class BrokenSource(MediaSource):
        async def run(self, stamp: object, emit: object) -> None:
            raise OSError("no camera")

    class HalfBlindRobot(RecordingRobot):
        def sources(self) -> list[MediaSource]:
            return [BrokenSource()]

    async with running_bridge(HalfBlindRobot()) as bridge, operator(bridge) as driver:
        await driver.heard(lambda feedback: bool(feedback.faults))
        assert driver.feedback.faults == ["media: OSError: no camera"]
        await driver.drive()


async def test_a_port_in_use_is_named_and_the_robot_is_released() -> None:
    async with running_bridge() as bridge:
        robot = RecordingRobot()
        with pytest.raises(ListenError, match="cannot listen"):
            await Bridge(robot, BridgeSettings(port=bridge.address[1])).start()
        assert robot.calls == ["close"]


def test_a_description_that_contradicts_itself_is_refused_before_anything_runs() -> None:
    class NoAxes(RecordingRobot):
        def describe(self) -> RobotDescription:
            return RobotDescription(name="none", label="None", axes=())

    with pytest.raises(DescriptionError, match="at least one axis"):
        Bridge(NoAxes(), BridgeSettings(port=0))


async def test_after_the_loop_was_blocked_there_is_no_burst_of_ticks() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge:
        await robot.until(lambda: len(robot.applied) > 3, "ticks")
        loop = asyncio.get_running_loop()
        before, end = len(robot.applied), loop.time() + 0.3
        while loop.time() < end:
            pass
        await robot.until(lambda: bridge.counters.skipped_ticks > 0, "skipped ticks")
        assert len(robot.applied) - before < 15
        assert bridge.counters.skipped_ticks > 50


async def test_the_log_tells_what_happened(tmp_path: Path) -> None:
    log = tmp_path / "events.jsonl"
    async with running_bridge(event_log=log) as bridge, operator(bridge) as driver:
        await driver.drive(DRIVE)
        await driver.refused(driver.command([0.0]))
        driver.link.send(Stop(by="Ada", reason="smoke"))
        await driver.heard(lambda feedback: feedback.stop.stopped)
        await driver.reset(by="Bob")
        driver.link.send(Rest(event=2))
    (start,) = log_lines(log, "start")
    assert start["epoch"] == bridge.epoch
    neutral, *_, executed = log_lines(log, "executed")
    assert (neutral["event"], neutral["values"]) == (2, NEUTRAL)
    assert executed["values"] == DRIVE
    event = cast(int, executed["event"])
    refused = next(line for line in log_lines(log, "refused") if line["reason"] == "wrong_size")
    assert (refused["event"], refused["current"]) == (event + 1, event)
    (stop,), (reset,) = log_lines(log, "stop"), log_lines(log, "reset")
    assert (stop["by"], reset["by"]) == ("Ada", "Bob")
    assert stop["number"] == reset["number"]
    assert [line["event"] for line in log_lines(log, "feedback")][0] == 1


async def test_a_robot_prepares_its_next_tick_when_the_feedback_of_this_one_was_sent() -> None:
    class Prepares(RecordingRobot):
        def tick(self) -> None:
            self.calls.append("tick")
            super().tick()

        def prepare(self) -> None:
            self.calls.append("prepare")

    robot = Prepares()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        publish = bridge._links.publisher.publish_feedback

        def published(feedback: Feedback) -> None:
            robot.calls.append("feedback")
            publish(feedback)

        def is_prepared_after_a_feedback() -> bool:
            return ("feedback", "prepare") in itertools.pairwise(ordered())

        def ordered() -> list[str]:
            return [call for call in robot.calls if call in ("tick", "feedback", "prepare")]

        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(bridge._links.publisher, "publish_feedback", published)
            await driver.drive_until(is_prepared_after_a_feedback)  # a tick that is late leaves no time for it
    assert {before for before, call in itertools.pairwise(ordered()) if call == "feedback"} == {"tick"}
    assert "tick" in ordered()[ordered().index("feedback") :], "and goes on"


async def test_the_measurement_is_taken_right_after_the_tick() -> None:
    class Watched(RecordingRobot):
        def tick(self) -> None:
            self.calls.append("tick")
            super().tick()

        def measure(self) -> Measurement:
            self.calls.append("measure")
            return super().measure()

    robot = Watched()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await driver.drive()
        del robot.calls[-1]
    measures = [index for index, call in enumerate(robot.calls) if call == "measure"][1:]
    assert measures
    assert all(robot.calls[index - 1] == "tick" for index in measures)
