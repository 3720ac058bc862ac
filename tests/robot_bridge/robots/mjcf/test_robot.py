"""A whole robot out of a file: described, driven on a bridge, seen."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import log_lines, operator
from tests.robot_bridge.robots.mjcf.models import ARM, EXAMPLE, model_file

# A white square on a black wall, moved sideways by a servo without inertia to speak of: where it is in the picture
# says where the slide was when the picture was taken.
SLIDE = """<mujoco><option timestep="0.004" gravity="0 0 0" integrator="implicitfast"/>
<visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
<worldbody><camera name="eye" pos="0 0 1" xyaxes="1 0 0 0 1 0" fovy="90"/>
<body name="mark"><joint name="x" type="slide" axis="1 0 0" range="-1 1" limited="true"/>
<geom type="box" size="0.05 0.3 0.001" rgba="1 1 1 1" mass="0.1"/></body></worldbody>
<actuator><velocity name="x" joint="x" kv="500" ctrlrange="-0.5 0.5" ctrllimited="true"/></actuator></mujoco>"""


@pytest.fixture
def example() -> Iterator[MjcfRobot]:
    yield from made(EXAMPLE)


@pytest.fixture
def slide(tmp_path: Path) -> Iterator[MjcfRobot]:
    yield from made(model_file(tmp_path, SLIDE))


def made(path: Path) -> Iterator[MjcfRobot]:
    robot = create(path)
    if not isinstance(robot, MjcfRobot):
        raise TypeError(robot)
    yield robot
    robot.close()


def test_the_example_is_described_by_its_file_alone(example: MjcfRobot) -> None:
    description = example.describe()
    check_description(description)
    assert description.label == "Desk arm"
    assert [axis.name for axis in description.axes] == ["waist", "shoulder", "elbow", "wrist", "gripper"]
    assert [camera.name for camera in description.cameras] == ["overview", "hand"]
    assert description.wrench is not None
    assert description.ranges is not None
    touched = {binding.axis for layer in description.layers for binding in layer.bindings if binding.touch}
    assert touched == {axis.name for axis in description.axes}
    for layer in description.layers:
        for attribute in ("pad", "touch", "key_positive", "key_negative"):
            used = [getattr(binding, attribute) for binding in layer.bindings if getattr(binding, attribute)]
            assert len(used) == len(set(used)), attribute


def test_the_example_stands_still_at_rest_and_moves_one_joint_at_a_time(example: MjcfRobot) -> None:
    def run(values: list[float], seconds: float) -> list[float]:
        for _ in range(round(seconds / example.tick_seconds)):
            example.apply(values)
            example.tick()
        return example.measure().joints

    rest = [0.0] * 5
    start = run(rest, 0.5)
    assert run(rest, 1.0)[:5] == pytest.approx(start[:5], abs=0.002)
    assert example.measure().at_rest
    moved = run([0.5, 0.0, 0.0, 0.0, 0.0], 1.0)
    assert not example.measure().at_rest
    assert moved[0] - start[0] == pytest.approx(0.5, abs=0.1)
    assert moved[1:4] == pytest.approx(start[1:4], abs=0.02)
    run(rest, 0.5)
    assert example.measure().at_rest
    assert example.measure().faults == []


def test_a_model_without_a_camera_is_looked_at_from_outside(tmp_path: Path) -> None:
    for robot in made(model_file(tmp_path, ARM)):
        assert [camera.name for camera in robot.describe().cameras] == ["free"]


async def test_no_picture_shows_an_older_state_than_its_stamp_says(slide: MjcfRobot, tmp_path: Path) -> None:
    """By the bridge's own log, and by where the mark is in the pixels: the slide only goes one way."""
    media: list[Media] = []
    log = tmp_path / "events.jsonl"
    places: dict[int, float] = {}

    async def receive(bridge: Bridge) -> None:
        async with RobotLink(*bridge.address, "media") as link:
            async for message in link:
                if isinstance(message, Media):
                    media.append(message)

    async with Bridge(slide, BridgeSettings(port=0, event_log=log)) as bridge, asyncio.timeout(40):
        receiving = asyncio.create_task(receive(bridge))
        async with operator(bridge) as driver:
            while len(media) < 15 or driver.feedback.event < 30 or driver.feedback.joints[0] < 0.12:
                feedback = await driver.drive([0.2 if driver.feedback.joints[0] < 0.7 else 0.0])
                places.setdefault(feedback.event, feedback.joints[0])
        receiving.cancel()
        await asyncio.wait([receiving])
    issued = [(line["time"], line["event"]) for line in log_lines(log, "feedback")]
    assert slide.measure().joints[0] > 0.1
    for picture in media:
        assert picture.stamp == max(event for time, event in issued if time <= picture.time)  # type: ignore[type-var, operator]
        if picture.stamp in places:
            pixel = 2.0 / picture.height  # m: the camera sees 2 m of height from 1 m away
            assert seen_place(picture, pixel) > places[picture.stamp] - 1.5 * pixel


def seen_place(picture: Media, pixel: float) -> float:
    luma = np.frombuffer(picture.payload, np.uint8)[: picture.width * picture.height]
    columns = np.flatnonzero(luma.reshape(picture.height, -1)[picture.height // 2] > 128)
    assert columns.size
    return float(columns.mean() + 0.5 - picture.width / 2) * pixel
