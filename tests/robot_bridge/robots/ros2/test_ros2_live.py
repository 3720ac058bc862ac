"""A bridge and a real ROS 2 node, each a process of its own, over DDS on loopback. What the node got is the truth."""

import asyncio
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lockstep.bench.harness.processes import running_process
from lockstep.protocol.messages import Command, Feedback, Media, Rest, Stop
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from tests.robot_bridge.bridge_helpers import Operator
from tests.support.ros2 import (
    EXAMPLES,
    PATIENCE,
    STAY,
    RosBridge,
    RosRobot,
    have_ros,
    ros_python,
    running_ros_bridge,
    running_ros_robot,
)

pytestmark = [
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
]

GO = [0.4, 0.3]
AGAIN = 1.0  # s, until a message is spoilt once more


@pytest.fixture
async def node(tmp_path: Path) -> AsyncIterator[RosRobot]:
    async with running_ros_robot(tmp_path) as robot:
        yield robot


@pytest.fixture
async def bridge(tmp_path: Path, node: RosRobot) -> AsyncIterator[RosBridge]:
    """A base whose watchdog lets a busy machine be slow: it would take a neutral command more."""
    settings = tmp_path / "base.yaml"
    settings.write_text((EXAMPLES / "base.yaml").read_text() + "\nwatchdog: 0.4\n")
    async with running_ros_bridge(tmp_path, node, settings) as running:
        yield running


class Driver(Operator):
    """An operator link that waits as long as DDS may take."""

    def __init__(self, link: RobotLink) -> None:
        super().__init__(link)
        self.link = link

    async def until(self, condition: Callable[[Feedback], bool]) -> Feedback:
        async with asyncio.timeout(PATIENCE):
            await self.heard(condition)
        return self.feedback

    async def ready(self) -> None:
        await self.next(Feedback)
        await self.until(lambda feedback: feedback.faults == [] and feedback.unknown == [])
        await self.arm()

    async def told_of(self, complaint: str, spoil: Callable[[], Awaitable[None]]) -> None:
        """Spoil messages until the feedback complains of N: sensors send without repeats, so that one may be lost."""
        pattern = re.escape(complaint).replace("N", r"[1-9]\d*", 1)
        async with asyncio.timeout(PATIENCE):
            while not any(re.fullmatch(pattern, fault) for fault in self.feedback.faults):
                await spoil()
                with suppress(TimeoutError):
                    async with asyncio.timeout(AGAIN):
                        await self.heard(lambda told: any(re.fullmatch(pattern, fault) for fault in told.faults))

    async def driven(self, values: list[float], condition: Callable[[Feedback], bool]) -> None:
        """Send these values, event by event, until the feedback meets the condition."""
        async with asyncio.timeout(PATIENCE):
            while not condition(self.feedback):
                await self.drive(values)


@pytest.fixture
async def driver(bridge: RosBridge) -> AsyncIterator[Driver]:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        operator = Driver(link)
        await operator.ready()
        yield operator


async def test_every_motion_ends_in_exactly_one_zero(bridge: RosBridge, node: RosRobot) -> None:
    """However it ends: hold ended, let go, stopped, link lost, bridge ended."""
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = Driver(link)
        await driver.ready()

        await driver.drive(GO)
        await driver.until(lambda feedback: feedback.at_rest and feedback.issue > 1)
        await node.ended_in_one_zero(motions=1)
        assert len(list(node.notes("twist"))) > 5, "the command was not repeated"

        await driver.driven(GO, lambda feedback: feedback.axes == GO)
        for _ in range(5):  # repeats of a rest say nothing new
            driver.link.send(Rest(event=driver.feedback.event))
        await driver.until(lambda feedback: feedback.at_rest)
        await node.ended_in_one_zero(motions=2)
        x, _, yaw = driver.feedback.joints
        assert x > 0
        assert yaw > 0
        assert min(driver.feedback.ranges) < 3.0
        assert max(driver.feedback.ranges) == 8.0

        await driver.driven(GO, lambda feedback: feedback.axes == GO)
        driver.link.send(Stop(by="test"))
        await driver.until(lambda feedback: feedback.stop.stopped and feedback.at_rest)
        await driver.reset()
        await node.ended_in_one_zero(motions=3)

        await driver.arm()
        await driver.driven(GO, lambda feedback: feedback.axes == GO)
    await node.ended_in_one_zero(motions=4)

    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = Driver(link)
        await driver.ready()
        await driver.driven(GO, lambda feedback: feedback.axes == GO)
        await bridge.process.end()
        await node.ended_in_one_zero(motions=5)
    assert all(forward <= GO[0] and turn <= GO[1] for forward, turn in (note["values"] for note in node.notes("twist")))


async def test_late_and_repeated_commands_do_not_reach_the_topic(
    driver: Driver, node: RosRobot, bridge: RosBridge
) -> None:
    """Each kind of command has a direction of its own, so that the node can tell which one it got."""
    frozen = driver.feedback
    first, age = event_after(frozen.event), bridge_age(driver)
    await driver.until(lambda feedback: feedback.time - frozen.time > age)
    late = Command(event=first, issue=frozen.issue, nonce=frozen.nonce, values=[-0.2, -1.0])
    assert (await driver.refused(late)).reason == "late"
    assert (await driver.refused(late)).reason == "late"
    await driver.next(Feedback)
    command = driver.command([0.3, 0.0])
    for _ in range(5):
        driver.link.send(command)
    await driver.until(lambda feedback: feedback.event == first)
    # The same event with another intention.
    driver.link.send(Command(event=first, issue=command.issue, nonce=command.nonce, values=[0.0, 1.2]))
    await driver.next(Feedback)
    assert (await driver.refused(Command(event=first + 7, issue=1, values=[0.0, 1.2]))).reason == "out_of_order"
    await driver.until(lambda feedback: feedback.at_rest)
    await node.ended_in_one_zero()
    twists = [note["values"] for note in node.notes("twist")]
    assert all(forward >= 0 and turn == 0 for forward, turn in twists), "a late or repeated command reached the topic"
    moving = [record["event"] for record in await bridge.records("executed") if any(record["values"])]
    assert moving == [first]


def bridge_age(driver: Driver) -> float:
    description = driver.link.hello.description
    assert description is not None
    return description.max_event_age


async def test_old_odometry_is_a_fault_is_not_shown_as_fresh_and_stops(driver: Driver, node: RosRobot) -> None:
    """A driver that hangs may be silent, or go on sending what it sent last."""
    for motion, how in enumerate(("hush", "freeze")):
        await driver.driven(GO, lambda feedback: feedback.axes == GO)
        await node.tell(f"{how} /odom")
        await driver.driven(GO, lambda feedback: bool(feedback.unknown))
        assert driver.feedback.unknown == ["base.vx", "base.wz", "base.x", "base.y", "base.yaw"]
        assert any(fault.startswith("/odom: no message for") for fault in driver.feedback.faults)
        assert not driver.feedback.at_rest
        await node.ended_in_one_zero(motion + 1)
        await node.tell("speak /odom")
        # Back again, but the stick was never let go: the robot must not start off by itself.
        await driver.driven(GO, lambda feedback: not feedback.unknown)
        await driver.drive(GO)
        assert any("let go of the controls once" in fault for fault in driver.feedback.faults)
        await node.ended_in_one_zero(motion + 1)
        await driver.driven(STAY, lambda feedback: feedback.faults == [])


async def test_bad_messages_are_counted_and_named_and_a_dead_robot_is_a_fault(driver: Driver, node: RosRobot) -> None:
    for topic, complaint in (
        ("/odom", "/odom: N × odometry with a value that is not a number"),
        ("/scan", "/scan: N × scan with invalid angles"),
        ("/image", "/camera/image_raw: N × picture in encoding '16UC1', which is not supported"),
    ):
        await driver.told_of(complaint, lambda topic=topic: node.tell(f"spoil {topic}"))  # type: ignore[misc]
        assert driver.feedback.unknown == []
    await driver.driven(GO, lambda feedback: feedback.axes == GO)
    await node.process.kill()
    await driver.driven(GO, lambda feedback: bool(feedback.unknown))
    lost = {"/odom: no message", "/scan: no message", "/camera/image_raw: no message"}
    await driver.driven(STAY, lambda feedback: lost <= {fault.partition(" for")[0] for fault in feedback.faults})


async def test_no_picture_is_stamped_newer_than_the_event_that_it_shows(
    driver: Driver, node: RosRobot, bridge: RosBridge
) -> None:
    """The camera's own record says when each picture was taken, the bridge's when each event began."""
    taken: dict[int, int] = {}  # picture's number -> stamp

    async def watch() -> None:
        async with RobotLink(*bridge.address, "media", name="test") as watcher:
            async for media in watcher:
                if isinstance(media, Media):
                    taken[picture_number(media)] = media.stamp

    watching = asyncio.create_task(watch())
    try:
        await driver.driven(GO, lambda _: len(taken) >= 25)
    finally:
        watching.cancel()
        await asyncio.wait([watching])
    began: dict[int, float] = {}
    for record in await bridge.records("feedback"):
        began.setdefault(record["event"], record["time"])
    pictures = await node.noted("picture", lambda notes: taken.keys() <= {note["number"] for note in notes})
    captured = {note["number"]: note["captured"] for note in pictures}
    newer = [number for number, stamp in taken.items() if began[stamp] > captured[number]]
    assert newer == []
    assert len(set(taken.values())) > 10, "the stamps did not move"


def picture_number(media: Media) -> int:
    planes = np.frombuffer(media.payload, np.uint8).reshape(media.height * 3 // 2, media.width)
    number = read_event_strip(planes[: media.height])
    assert number is not None
    return number


async def test_an_arm_is_driven_a_short_way_ahead_and_told_to_stay_once(tmp_path: Path, node: RosRobot) -> None:
    async with (
        running_ros_bridge(tmp_path, node, EXAMPLES / "arm.yaml") as bridge,
        RobotLink(*bridge.address, "operator", name="test") as link,
    ):
        operator = Driver(link)
        await operator.ready()
        await operator.driven([0.5, 0.0, 0.0, 0.0, 0.0, -0.5], lambda feedback: feedback.joints[0] > 0.2)
        assert operator.feedback.axes[0] > 0.1
        assert operator.feedback.wrench[2] < -1.0
        await operator.until(lambda feedback: feedback.at_rest)
        await node.noted("trajectory", lambda notes: len(notes) > 5 and stays(notes))
    for _ in range(5):  # a further word would come within two of the bridge's repeats
        await node.tell("tick")
    notes = list(node.notes("trajectory"))
    assert all(note["span"] == pytest.approx(0.1) for note in notes)
    ahead = [note["positions"][0] - note["measured"][0] for note in notes]
    assert max(ahead) < 0.8 * 0.5 + 0.8 * 0.1, "the arm was told to go farther than it may"
    assert stays(notes), "the last word was not to stay"
    assert all(note["positions"] != notes[-1]["positions"] for note in notes[:-1])


def stays(notes: list[Any]) -> bool:
    """The last word leads no further than the one before."""
    *_, before, last = notes
    return bool(last["positions"][0] <= before["positions"][0])


async def test_plain_twists_and_joint_states_are_spoken_too(tmp_path: Path, node: RosRobot) -> None:
    settings = tmp_path / "both.yaml"
    settings.write_text(
        "name: both\nhold: 0.5\nwatchdog: 0.4\n"
        "base:\n  forward: {maximum: 0.5}\n  turn: {maximum: 1}\n"
        "  command: {topic: /cmd_vel_plain, message: Twist}\n"
        "arm:\n  command: {topic: /joint_command, message: JointState}\n  joints:\n"
        + "".join(
            f"    - {{name: {name}, maximum: 1.0}}\n"
            for name in ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint")
            + tuple(f"wrist_{number}_joint" for number in (1, 2, 3))
        )
    )
    async with (
        running_ros_bridge(tmp_path, node, settings) as bridge,
        RobotLink(*bridge.address, "operator", name="test") as link,
    ):
        operator = Driver(link)
        await operator.ready()
        await operator.driven([0.3, 0.0, 0.5] + [0.0] * 5, lambda feedback: feedback.joints[3] > 0.1)
        await operator.until(lambda feedback: feedback.at_rest)
        await node.ended_in_one_zero()
    joints = await node.noted("joints", lambda notes: bool(notes) and not any(notes[-1]["velocities"]))
    assert max(note["velocities"][0] for note in joints) <= 0.5
    assert [any(note["velocities"]) for note in joints].count(False) == 1
    assert joints[-1]["velocities"] == [0.0] * 6


async def test_nobody_who_listens_is_a_fault_that_names_the_message(tmp_path: Path, node: RosRobot) -> None:
    settings = tmp_path / "deaf.yaml"
    settings.write_text("name: deaf\nbase:\n  forward: {maximum: 0.5}\n  command: {topic: /nobody}\n")
    async with (
        running_ros_bridge(tmp_path, node, settings) as bridge,
        RobotLink(*bridge.address, "operator", name="test") as link,
    ):
        operator = Driver(link)
        await operator.next(Feedback)
        fault = ["/nobody: no subscriber for TwistStamped"]
        await operator.until(lambda feedback: (feedback.unknown, feedback.faults) == ([], fault))
        await operator.drive([0.4])
        assert operator.feedback.axes == [0.0]


async def test_the_bridge_needs_nothing_of_the_console() -> None:
    """What runs beside the robot's ROS installation is light."""
    heavy = ["aiortc", "av", "fastapi", "httpx", "mujoco", "uvicorn", "viser", "websockets"]
    look = "import importlib.util, json; print(json.dumps({m: importlib.util.find_spec(m) is None for m in %r}))"
    async with running_process(ros_python(), "-c", look % heavy) as (_, missing):
        assert missing == dict.fromkeys(heavy, True)
