"""What docs/robot-link.md promises of events and media, asked of the robot in C and of our own bridge alike."""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from robot_bridge.check_description import check_description
from robot_bridge.link_client import RobotLink
from robot_bridge.protocol.errors import LinkLost, LinkRefused
from robot_bridge.protocol.messages import (
    Command,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    Media,
    Ping,
    Refusal,
    Reset,
    Rest,
    Stop,
    StopTaken,
)
from robot_bridge.protocol.serial import MAX_EVENT, event_after
from robot_bridge.robots.event_strip import read_event_strip
from tests.docs.examples.robots import Robot, description_of, moving
from tests.robot_bridge.bridge_helpers import operator, raw_link
from tests.support.c_robot import running_c_robot


async def test_the_hello_describes_a_robot_that_makes_sense(robot: Robot) -> None:
    async with operator(robot) as driver:
        check_description(description_of(driver))
        assert driver.link.hello.epoch
        assert len(driver.feedback.axes) == len(description_of(driver).axes)
        assert len(driver.feedback.joints) == len(description_of(driver).joints)
        assert (driver.feedback.event, driver.feedback.at_rest) == (2, True)


async def test_the_event_subscriber_gets_notices_and_no_description(robot: Robot) -> None:
    async with raw_link(robot) as link, operator(robot) as driver:
        link.send(Hello(role="events"))
        assert (await link.find(Hello)).description is None
        await driver.drive(moving(driver))
        while (await link.find(EventNotice)).event != 3:
            pass


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


async def test_after_a_late_command_a_fresh_feedback_comes_and_only_it_may_be_answered(robot: Robot) -> None:
    async with operator(robot) as driver:
        before = driver.feedback
        age = description_of(driver).max_event_age
        await driver.heard(lambda feedback: feedback.time - before.time > age)
        late = Command(event=3, issue=before.issue, values=moving(driver), nonce=before.nonce)
        assert (await driver.refused(late)).reason == "late"
        assert (await driver.next(Feedback)).issue > before.issue
        assert (await driver.refused(late)).reason == "late"
        assert (await driver.drive(moving(driver))).event >= 3


async def test_without_another_command_the_robot_comes_to_rest(robot: Robot) -> None:
    async with operator(robot) as driver:
        moved = await driver.drive(moving(driver))
        await driver.heard(lambda feedback: feedback.at_rest and feedback.issue > 1)
        assert driver.feedback.event == moved.event


async def test_a_rest_voids_moving_commands_up_to_its_event_and_lets_neutral_ones_pass(robot: Robot) -> None:
    async with operator(robot) as driver:
        await driver.drive(moving(driver))
        following = event_after(driver.feedback.event)
        driver.link.send(Rest(event=following))
        refusal = await driver.refused(driver.command(moving(driver)))
        assert (refusal.reason, refusal.event) == ("rested", following)
        await driver.drive([0.0] * len(driver.feedback.axes))
        assert (await driver.drive(moving(driver))).event > following


async def test_a_rest_for_an_event_that_is_past_does_nothing(robot: Robot) -> None:
    async with operator(robot) as driver:
        await driver.drive(moving(driver))
        driver.link.send(Rest(event=1))
        await driver.drive(moving(driver))
    rests = await robot.records("rest")
    assert [line["applied"] for line in rests] == [False]


async def test_a_rest_far_ahead_rests_but_voids_only_the_next_event(robot: Robot) -> None:
    async with operator(robot) as driver:
        driver.link.send(Rest(event=500))
        assert (await driver.refused(driver.command(moving(driver)))).reason == "rested"
        await driver.drive([0.0] * len(driver.feedback.axes))
        assert (await driver.drive(moving(driver))).event >= 4


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


async def test_after_a_reset_the_robot_moves_only_after_a_neutral_command(robot: Robot) -> None:
    async with operator(robot) as driver:
        driver.link.send(Stop())
        await driver.heard(lambda feedback: feedback.stop.stopped)
        await driver.reset()
        assert (await driver.refused(driver.command(moving(driver)))).reason == "not_neutral"
        assert not (await driver.drive([0.0] * len(driver.feedback.axes))).neutral_needed
        assert (await driver.drive(moving(driver))).event >= 4


async def test_a_new_operator_link_moves_the_robot_only_after_a_neutral_command(robot: Robot) -> None:
    for _ in range(2):
        async with operator(robot, armed=False) as driver:
            assert driver.feedback.neutral_needed
            assert (await driver.refused(driver.command(moving(driver)))).reason == "not_neutral"
            await driver.arm()
            await driver.drive(moving(driver))


async def test_each_press_has_a_number_and_its_repeats_have_the_same(robot: Robot) -> None:
    async with operator(robot) as driver, raw_link(robot, "events") as watcher:
        numbers = []
        for press in ("0" * 32, "1" * 32, "0" * 32, "", ""):
            watcher.send(Stop(press=press))
            taken = await watcher.find(StopTaken)
            assert taken.press == press
            numbers.append(taken.number)
        first, second, again, other, last = numbers
        assert 0 < first < second < other < last
        assert again == first
        await driver.heard(lambda feedback: feedback.stop.number == last)
        assert driver.feedback.stop.press == ""


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


async def test_a_lost_operator_leaves_the_robot_at_rest_and_its_place_to_another(robot: Robot) -> None:
    async with operator(robot) as driver:
        with pytest.raises(LinkRefused, match="taken"):
            await RobotLink(*robot.address, "operator").connect()
        last = await driver.drive(moving(driver))
    async with operator(robot) as successor:
        assert successor.feedback.event == event_after(last.event), "its neutral command is the next event"
        await successor.heard(lambda feedback: feedback.at_rest)


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
