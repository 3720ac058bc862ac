"""What docs/robot-link.md promises of events and media, asked of the robot in C and of our own bridge alike."""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from lockstep.protocol.errors import LinkLost
from lockstep.protocol.messages import Command, Feedback, Goodbye, Media, Ping, Refusal, Reset, Rest, Stop, StopTaken
from lockstep.protocol.serial import MAX_EVENT, event_after
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from tests.docs.examples.robots import Robot, description_of, moving
from tests.robot_bridge.bridge_helpers import operator, raw_link
from tests.support.c_robot import running_c_robot


async def test_each_command_executes_once_and_a_repeat_gets_the_stored_feedback(robot: Robot) -> None:
    async with operator(robot) as driver:
        for _ in range(5):
            command = driver.command(moving(driver))
            fed_back = await driver.drive(moving(driver))
            driver.link.send(command)
            repeated = await driver.next(Feedback)
            assert repeated.event == fed_back.event
        assert driver.feedback.axes[0] > 0
    executed = await robot.records("executed")
    assert [line["event"] for line in executed] == list(range(2, 2 + len(executed)))
    assert len(executed) >= 6  # one more wherever a busy machine held up the robot, which then took a neutral command


async def test_copies_sent_at_once_execute_once(robot: Robot) -> None:
    async with operator(robot) as driver:
        for _ in range(5):
            driver.link.send(driver.command(moving(driver)))
        while driver.feedback.event != 3:
            await driver.next(Feedback)
        await driver.drive(moving(driver))
    executed = [line["event"] for line in await robot.records("executed")]
    assert executed == list(range(2, 2 + len(executed)))
    assert len(executed) >= 3  # one more where a busy machine held up the robot, which then took a neutral command


def commands(feedback: Feedback, axes: int) -> Iterator[tuple[str, Command]]:
    """Each with the reason that it has to be refused for."""
    following, still = event_after(feedback.event), [0.0] * axes
    yield "wrong_size", Command(event=following, issue=feedback.issue, values=[])
    yield "wrong_size", Command(event=following, issue=feedback.issue, values=[0.0] * (axes + 1))
    yield "not_a_number", Command(event=following, issue=feedback.issue, values=[math.nan, *still[1:]])
    yield "not_a_number", Command(event=following, issue=feedback.issue, values=[-math.inf, *still[1:]])
    yield "out_of_order", Command(event=event_after(following), issue=feedback.issue, values=still)
    yield "out_of_order", Command(event=MAX_EVENT, issue=feedback.issue, values=still)
    yield "late", Command(event=following, issue=feedback.issue + 1000, values=still)
    yield "unseen", Command(event=following, issue=feedback.issue, values=still)
    yield "unseen", Command(event=following, issue=feedback.issue, values=still, nonce=feedback.nonce ^ 1)


async def test_what_must_not_execute_is_refused_with_its_reason(robot: Robot) -> None:
    async with operator(robot) as driver:
        for reason, command in commands(driver.feedback, len(driver.feedback.axes)):
            refusal = await driver.refused(command)
            assert (refusal.reason, refusal.event, refusal.current) == (reason, command.event, 2)
    executed = await robot.records("executed")
    assert [line["event"] for line in executed] == [2]


async def test_a_rest_for_an_event_that_is_past_does_nothing(robot: Robot) -> None:
    async with operator(robot) as driver:
        await driver.drive(moving(driver))
        driver.link.send(Rest(event=1))
        await driver.drive(moving(driver))
    rests = await robot.records("rest")
    assert [line["applied"] for line in rests] == [False]


async def test_any_client_may_stop_and_only_the_operator_resets(robot: Robot) -> None:
    async with operator(robot) as driver, raw_link(robot, "media") as watcher:
        await driver.drive(moving(driver))
        watcher.send(Stop(by="somebody ☂", reason="smoke"))
        await driver.heard(lambda feedback: feedback.stop.stopped and feedback.at_rest)
        assert (driver.feedback.stop.by, driver.feedback.stop.reason) == ("somebody ☂", "smoke")
        assert (await driver.refused(driver.command(moving(driver)))).reason == "stopped"
        watcher.send(Reset(by="somebody"))
        assert (await watcher.find(Refusal)).reason == "not_allowed"
        await driver.reset(by="operator")
        assert driver.feedback.at_rest


async def test_only_the_newest_stop_can_be_reset_and_only_after_a_second(robot: Robot) -> None:
    async with operator(robot) as driver:
        driver.link.send(Stop(press="a" * 32, reason="smoke"))
        await driver.heard(lambda feedback: feedback.stop.stopped)
        first = driver.feedback.stop.number
        refusal = await driver.refused(Reset(number=first))
        assert (refusal.reason, refusal.stop, refusal.event) == ("too_soon", first, 0)
        driver.link.send(Stop(press="b" * 32, reason="fire"))
        await driver.heard(lambda feedback: feedback.stop.number > first)
        refusal = await driver.refused(Reset(number=first))
        assert (refusal.reason, refusal.stop) == ("stale_reset", first)
        assert (driver.feedback.stop.reason, driver.feedback.stop.press) == ("smoke", "b" * 32)
        newest = await driver.reset()
        driver.link.send(Reset(number=newest))
        driver.link.send(Stop(press="b" * 32))
        assert (await driver.next(StopTaken)).number == newest
        await driver.arm()
        assert not driver.feedback.stop.stopped, "a repeat of a press that was reset is no new stop"
        await driver.drive(moving(driver))


async def test_pictures_are_of_the_described_size_and_never_stamped_newer_than_the_truth(robot: Robot) -> None:
    async with operator(robot) as driver, raw_link(robot, "media") as watcher:
        cameras = {camera.name: camera for camera in description_of(driver).cameras}
        seen: set[int] = set()
        while len(seen) < 5:
            await driver.drive(moving(driver))
            media = await watcher.find(Media)
            watcher.send(Ping(id=1))
            if media.codec != "yuv420p":
                continue
            camera = cameras[media.stream]
            assert (media.width, media.height) == (camera.width, camera.height)
            picture = np.frombuffer(media.payload, np.uint8).reshape(camera.height * 3 // 2, camera.width)
            assert read_event_strip(picture[: camera.height]) == media.stamp
            seen.add(media.stamp)
    began: dict[int, float] = {}
    for line in await robot.records("feedback", "media"):
        if line["kind"] == "feedback":
            began.setdefault(line["event"], line["time"])
        else:
            assert began[line["event"]] <= line["captured"]


async def test_on_its_signal_it_says_goodbye_with_the_robot_at_rest(tmp_path: Path) -> None:
    async with running_c_robot(tmp_path) as running, operator(running) as driver:
        await driver.drive(moving(driver))
        running.process.terminate()
        with pytest.raises(LinkLost, match="closing"):
            await driver.next(Goodbye)
        assert await running.end() == (0, "")
    lines = [json.loads(line) for line in running.event_log.read_text().splitlines()]
    states = [line["kind"] for line in lines if line["kind"] in ("driven", "at_rest")]
    assert states == ["driven", "at_rest"]
