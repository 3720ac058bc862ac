"""What docs/robot-link.md promises, asked from outside of the robot in C and of our own bridge alike."""

import asyncio
import json
import math
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from robot_bridge.bridge import Bridge
from robot_bridge.check_description import check_description
from robot_bridge.link_client import RobotLink
from robot_bridge.protocol.description import RobotDescription
from robot_bridge.protocol.errors import LinkLost, LinkRefused
from robot_bridge.protocol.framing import frame
from robot_bridge.protocol.messages import (
    Command,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    Media,
    Ping,
    Pong,
    Refusal,
    Reset,
    Rest,
    Stop,
    encode_message,
)
from robot_bridge.protocol.serial import MAX_EVENT, event_after
from robot_bridge.robots.event_strip import read_event_strip
from robot_bridge.robots.planar import create
from robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import Operator, operator, raw_link
from tests.support.c_robot import running_c_robot


@dataclass
class Robot:
    """A robot at an address, its own record, and how often it may see a neutral or a moving command."""

    address: tuple[str, int]
    event_log: Path
    close: Callable[[], Any]

    async def records(self, *kinds: str) -> list[dict[str, Any]]:
        """What it has written down; call at the end, it is closed first."""
        await self.close()
        lines = [json.loads(line) for line in self.event_log.read_text().splitlines()]
        return [line for line in lines if line["kind"] in kinds]


@asynccontextmanager
async def in_c(directory: Path) -> AsyncIterator[Robot]:
    async with running_c_robot(directory) as robot:
        yield Robot(robot.address, robot.event_log, robot.end)


@asynccontextmanager
async def in_python(directory: Path) -> AsyncIterator[Robot]:
    log = directory / "bridge.jsonl"
    async with Bridge(create(), BridgeSettings(port=0, event_log=log)) as bridge:
        yield Robot(bridge.address, log, bridge.close)


@pytest.fixture(params=[in_c, in_python], ids=["c", "python"])
async def robot(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Robot]:
    async with request.param(tmp_path) as running:
        yield running


def moving(driver: Operator) -> list[float]:
    """Half speed forward, whatever the robot's axes are."""
    axes = description_of(driver).axes
    return [axes[0].maximum / 2] + [axis.rest for axis in axes[1:]]


def description_of(driver: Operator) -> RobotDescription:
    description = driver.link.hello.description
    assert description is not None
    return description


async def test_the_hello_describes_a_robot_that_makes_sense(robot: Robot) -> None:
    async with operator(robot) as driver:
        check_description(description_of(driver))
        assert driver.link.hello.epoch
        assert len(driver.feedback.axes) == len(description_of(driver).axes)
        assert len(driver.feedback.joints) == len(description_of(driver).joints)
        assert (driver.feedback.event, driver.feedback.at_rest) == (1, True)


async def test_the_event_subscriber_gets_notices_and_no_description(robot: Robot) -> None:
    async with raw_link(robot) as link, operator(robot) as driver:
        link.send(Hello(role="events"))
        assert (await link.find(Hello)).description is None
        await driver.drive(moving(driver))
        while (await link.find(EventNotice)).event != 2:
            pass


async def test_each_command_executes_once_and_a_repeat_gets_the_stored_feedback(robot: Robot) -> None:
    async with operator(robot) as driver:
        for _ in range(5):
            command = driver.command(moving(driver))
            fed_back = await driver.drive(moving(driver))
            driver.link.send(command)
            repeated = await driver.next(Feedback)
            assert repeated.event == fed_back.event
        assert driver.feedback.event == 6
        assert driver.feedback.axes[0] > 0
    executed = await robot.records("executed")
    assert [line["event"] for line in executed] == [2, 3, 4, 5, 6]


async def test_copies_sent_at_once_execute_once(robot: Robot) -> None:
    async with operator(robot) as driver:
        for _ in range(5):
            driver.link.send(driver.command(moving(driver)))
        while driver.feedback.event != 2:
            await driver.next(Feedback)
        await driver.drive(moving(driver))
    executed = await robot.records("executed")
    assert [line["event"] for line in executed] == [2, 3]


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


async def test_what_must_not_execute_is_refused_with_its_reason(robot: Robot) -> None:
    async with operator(robot) as driver:
        await driver.drive([0.0] * len(driver.feedback.axes))
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
        late = Command(event=2, issue=before.issue, values=moving(driver))
        assert (await driver.refused(late)).reason == "late"
        assert (await driver.next(Feedback)).issue > before.issue
        assert (await driver.refused(late)).reason == "late"
        assert (await driver.drive(moving(driver))).event == 2


async def test_without_another_command_the_robot_comes_to_rest(robot: Robot) -> None:
    async with operator(robot) as driver:
        await driver.drive(moving(driver))
        await driver.heard(lambda feedback: feedback.at_rest and feedback.issue > 1)
        assert driver.feedback.event == 2


async def test_a_rest_voids_moving_commands_up_to_its_event_and_lets_neutral_ones_pass(robot: Robot) -> None:
    async with operator(robot) as driver:
        await driver.drive(moving(driver))
        driver.link.send(Rest(event=3))
        refusal = await driver.refused(driver.command(moving(driver)))
        assert (refusal.reason, refusal.event) == ("rested", 3)
        await driver.drive([0.0] * len(driver.feedback.axes))
        assert (await driver.drive(moving(driver))).event == 4


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
        assert (await driver.drive(moving(driver))).event == 3


async def test_any_client_may_stop_and_only_the_operator_resets(robot: Robot) -> None:
    async with operator(robot) as driver, raw_link(robot, "media") as watcher:
        await driver.drive(moving(driver))
        watcher.send(Stop(by="somebody ☂", reason="smoke"))
        await driver.heard(lambda feedback: feedback.stop.stopped and feedback.at_rest)
        assert (driver.feedback.stop.by, driver.feedback.stop.reason) == ("somebody ☂", "smoke")
        assert (await driver.refused(driver.command(moving(driver)))).reason == "stopped"
        watcher.send(Reset(by="somebody"))
        assert (await watcher.find(Refusal)).reason == "not_allowed"
        driver.link.send(Reset(by="operator"))
        await driver.heard(lambda feedback: not feedback.stop.stopped)
        assert driver.feedback.at_rest
        assert (await driver.drive(moving(driver))).event == 3


async def test_a_lost_operator_leaves_the_robot_at_rest_and_its_place_to_another(robot: Robot) -> None:
    async with operator(robot) as driver:
        with pytest.raises(LinkRefused, match="taken"):
            await RobotLink(*robot.address, "operator").connect()
        await driver.drive(moving(driver))
    async with operator(robot) as successor:
        assert successor.feedback.event == 2
        await successor.heard(lambda feedback: feedback.at_rest)


async def test_a_ping_is_answered_with_its_number(robot: Robot) -> None:
    async with raw_link(robot, "media") as link:
        link.send(Ping(id=-77), Ping(id=2**53))
        while (await link.find(Pong)).id != 2**53:
            pass


async def test_who_says_nothing_is_told_so(robot: Robot) -> None:
    async with raw_link(robot, "operator") as mute, raw_link(robot) as stranger:
        assert (await mute.find(Goodbye)).error == "silent"
        assert (await stranger.find(Goodbye)).error == "silent"


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (bytes(4), "framing"),
        (b"\xff\xff\xff\xff", "framing"),
        (b"\x00\x00\x20\x01", "framing"),
        (frame(b"\xc1"), "handshake"),
        (frame(encode_message(Ping(id=1))), "handshake"),
        (frame(encode_message(Hello(role="robot"))), "role"),
        (frame(encode_message(Hello(role="operator", version=2))), "version"),
    ],
    ids=["empty", "longest", "too-long", "no-message", "no-hello", "role", "version"],
)
async def test_a_bad_beginning_is_answered_with_a_goodbye_that_names_it(robot: Robot, data: bytes, error: str) -> None:
    async with raw_link(robot) as link:
        link.writer.write(data)
        assert (await link.find(Goodbye)).error == error
        assert await link.next() is None


def malformed() -> Iterator[bytes]:
    """Frames that are no messages."""
    yield b"\x93\x01\x02\x03"
    yield b"\xdf\xff\xff\xff\xff"
    yield b"\x81\xa4type\xa4none"
    yield b"\x81\xa4type\xa7command"
    yield encode_message(Stop(by="x")) + b"\x00"
    yield b"\x82\xa4type\xa4stop\xa2by\xa2\xc3\x28"  # not UTF-8
    yield b"\x82\xa4type\xa4stop\xa2by\xda\x01\xf5" + b"x" * 501
    yield b"\x82\xa4type\xa4rest\xa5event\x00"
    yield b"\x82\xa4type\xa4rest\xa5event\xce\x80\x00\x00\x00"
    yield b"\x84\xa4type\xa7command\xa5event\x02\xa5issue\x01\xa6values\xa3abc"
    yield b"\x84\xa4type\xa7command\xa5event\x02\xa5issue\x00\xa6values\x90"


async def test_malformed_messages_are_refused_and_the_link_stays(robot: Robot) -> None:
    async with raw_link(robot, "operator") as link:
        for payload in malformed():
            link.writer.write(frame(payload))
            refusal = await link.find(Refusal)
            assert refusal.reason == "malformed", payload
        link.send(Stop(by="x"))
        while not (await link.find(Feedback)).stop.stopped:
            pass


async def test_unknown_fields_are_passed_over(robot: Robot) -> None:
    async with raw_link(robot, "operator") as link:
        link.writer.write(frame(b"\x83\xa4type\xa4stop\xa3new\x92\x81\x01\x90\xc0\xa2by\xa1x"))
        while (await link.find(Feedback)).stop.by != "x":
            pass


async def test_what_a_role_may_not_say_is_refused(robot: Robot) -> None:
    forbidden: list[tuple[LinkRole, LinkMessage]] = [
        ("media", Command(event=2, issue=1, values=[])),
        ("events", Rest(event=2)),
        ("events", Reset()),
        ("operator", Hello(role="operator")),
        ("operator", EventNotice(event=1, time=0.0)),
    ]
    for role, message in forbidden:
        async with raw_link(robot, role) as link:
            link.send(message)
            assert (await link.find(Refusal)).reason == "not_allowed"


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


async def test_who_does_not_read_is_dropped_and_holds_nobody_up(robot: Robot) -> None:
    async with operator(robot) as driver:
        reader, writer = await asyncio.open_connection(*robot.address, limit=1024)
        try:
            writer.write(frame(encode_message(Hello(role="media"))))

            async def keep_alive() -> None:
                while True:
                    writer.write(frame(encode_message(Ping(id=1))))
                    await writer.drain()
                    await driver.drive(moving(driver))

            with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
                async with asyncio.timeout(20):
                    await keep_alive()
        finally:
            writer.close()
        await driver.drive(moving(driver))


async def test_more_links_than_there_is_room_for_are_turned_away(robot: Robot) -> None:
    links = [RobotLink(*robot.address, "events") for _ in range(32)]
    try:
        for link in links:  # not all at once: more than 16 that nobody has admitted yet are too many
            await link.connect()
        with pytest.raises(LinkRefused, match="full"):
            await RobotLink(*robot.address, "events").connect()
    finally:
        await asyncio.gather(*(link.close() for link in links))
    async with operator(robot) as driver:
        await driver.drive(moving(driver))


def spoilt(random: Random) -> bytes:
    """A frame that was once a message; no stop, which might still be one."""
    whole: list[LinkMessage] = [
        Command(event=2, issue=1, values=[0.0, 0.0]),
        Rest(event=2),
        Ping(id=5),
        Hello(role="operator", name="x" * 20),
        Goodbye(error="closing", detail="ü" * 9),
    ]
    data = bytearray(encode_message(random.choice(whole)))
    for _ in range(random.randrange(1, 5)):
        match random.randrange(3):
            case 0:
                data[random.randrange(len(data))] = random.randrange(256)
            case 1:
                del data[random.randrange(len(data)) :]
                data += random.randbytes(random.randrange(1, 9))
            case 2:
                at = random.randrange(len(data))
                data[at:at] = random.randbytes(random.randrange(1, 5))
    return bytes(data)


async def test_hostile_bytes_disturb_nobody(robot: Robot) -> None:
    """With the sanitizers on, a byte read or written where there is none ends the robot in C."""
    random = Random(4)
    async with operator(robot) as driver:
        for _ in range(60):
            reader, writer = await asyncio.open_connection(*robot.address)
            if random.random() < 0.6:
                writer.write(frame(encode_message(Hello(role=random.choice(["events", "media"])))))
            for _ in range(30):
                writer.write(frame(spoilt(random)))
            if random.random() < 0.3:
                writer.write(random.randbytes(200))
            writer.close()
            await driver.drive([0.0] * len(driver.feedback.axes))


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
