"""Pictures and sound: what they show, and how they are stamped."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.robot_bridge.robots.micromanipulator.description import MICROPHONE, MICROSCOPE, SIDE
from lockstep.robot_bridge.robots.micromanipulator.microscope import Microscope
from lockstep.robot_bridge.robots.micromanipulator.needle import Contact
from lockstep.robot_bridge.robots.micromanipulator.robot import Micromanipulator, MicromanipulatorState
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO, SAMPLES
from lockstep.robot_bridge.robots.micromanipulator.side_view import SideView
from lockstep.robot_bridge.robots.micromanipulator.sound import SEGMENT_SAMPLES, Sound
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import log_lines, operator

Luma = npt.NDArray[np.int16]
DROP = SAMPLES[0]
EVENT = 123_456_789


@pytest.fixture(scope="module")
def microscope() -> Microscope:
    return Microscope(MICROSCOPE.width, MICROSCOPE.height)


def at(x: float, y: float, z: float, **more: Any) -> MicromanipulatorState:
    place = (x * MICRO, y * MICRO, z * MICRO)
    return MicromanipulatorState(holder=place, tip=place)._replace(**more)


def luma_of(microscope: Microscope, state: MicromanipulatorState) -> Luma:
    picture = microscope.draw(state, EVENT)
    planes = np.frombuffer(picture, np.uint8)[: MICROSCOPE.width * MICROSCOPE.height]
    return planes.reshape(MICROSCOPE.height, -1).astype(np.int16)


def part(luma: Luma, x: float, y: float, size: float = 12.0) -> Luma:
    """Around a place in µm."""
    scale = (MICROSCOPE.metres_per_pixel or 1) / MICRO
    row = round(MICROSCOPE.height / 2 - x / scale)
    column, reach = round(MICROSCOPE.width / 2 - y / scale), round(size / scale)
    return luma[row - reach : row + reach, column - reach : column + reach]


def sharpness(luma: Luma) -> float:
    return float(np.abs(np.diff(luma, axis=0)).mean() + np.abs(np.diff(luma, axis=1)).mean())


FAR = at(-80, -130, 80)  # nearly out of sight


@pytest.mark.parametrize("state", [at(0, 0, 40), at(110, 145, 0), at(-90, -145, 90), FAR, at(0, 0, 5, light=20.0)])
def test_a_picture_is_whole_and_nothing_lies_over_it(microscope: Microscope, state: MicromanipulatorState) -> None:
    picture = microscope.draw(state, EVENT)
    assert len(picture) == MICROSCOPE.width * MICROSCOPE.height * 3 // 2
    luma = np.frombuffer(picture, np.uint8)[: MICROSCOPE.width * MICROSCOPE.height].reshape(MICROSCOPE.height, -1)
    assert read_event_strip(luma) is None
    assert luma.min() >= 5  # grain has not wrapped around
    assert luma.max() <= 250


@pytest.mark.parametrize("place", [at(0, 0, 40), at(60, 140, 5), at(-60, -140, 60)])
def test_the_side_view_is_whole_and_nothing_lies_over_it(place: MicromanipulatorState) -> None:
    picture = SideView(SIDE.width, SIDE.height).draw(place, EVENT)
    assert len(picture) == SIDE.width * SIDE.height * 3 // 2
    luma = np.frombuffer(picture, np.uint8)[: SIDE.width * SIDE.height].reshape(SIDE.height, -1)
    assert read_event_strip(luma) is None
    assert luma.std() > 20


def test_the_needle_is_where_the_tip_is_and_forward_is_up(microscope: Microscope) -> None:
    empty = luma_of(microscope, FAR)
    for x, y in ((0.0, 0.0), (40.0, -30.0), (-20.0, 50.0)):
        difference = np.abs(luma_of(microscope, at(x, y, 0.5)) - empty)
        assert part(difference, x - 10, y - 5, 4).mean() > 15
        assert part(difference, x + 20, y + 10, 6).mean() < 4


def test_a_tip_above_the_focal_plane_is_unsharp_and_the_focus_follows_it(microscope: Microscope) -> None:
    """Seen over bare glass, as a difference to the picture without it."""

    def seen(height: float, focus: float) -> float:
        alone = FAR._replace(focus=focus * MICRO)
        state = at(10, -10, height, focus=focus * MICRO)
        return sharpness(part(luma_of(microscope, state) - luma_of(microscope, alone), 2, -14))

    assert seen(1, 0) > 1.5 * seen(40, 0)
    assert seen(40, 40) > 1.5 * seen(40, 0)


def test_a_view_that_was_moved_shows_the_same_slide_needle_and_dent_at_other_places(microscope: Microscope) -> None:
    x, y = DROP.x / MICRO, DROP.y / MICRO
    pressed = at(x, y, 2, contact=Contact(DROP, 8 * MICRO, (2 * MICRO, 0.0)))
    straight = luma_of(microscope, pressed)
    for ahead, left in ((20.0, 30.0), (-12.5, 8.5), (30.0, -50.0)):
        moved = luma_of(microscope, pressed._replace(view=(ahead * MICRO, left * MICRO)))
        for place in ((x, y), (x - 10, y - 5), (x - 20, y)):  # tip and dent, needle, the drop's edge
            one, other = part(straight, *place, 8), part(moved, place[0] - ahead, place[1] - left, 8)
            alike = np.corrcoef(one.ravel(), other.ravel())[0, 1]
            assert alike > 0.99, place  # but for the lens' shading, and the grain


@pytest.mark.parametrize(("ahead", "left"), [(60, 80), (-60, -80), (60, -80)])
def test_all_of_the_views_range_is_drawn(microscope: Microscope, ahead: float, left: float) -> None:
    luma = luma_of(microscope, at(0, 0, 40, view=(ahead * MICRO, left * MICRO)))
    assert luma.min() >= 5
    assert luma.max() <= 250


def test_the_slide_is_sharp_only_in_focus(microscope: Microscope) -> None:
    def slide(focus: float) -> float:
        return sharpness(luma_of(microscope, FAR._replace(focus=focus * MICRO))[:, 120:520])

    assert slide(3) > 1.15 * slide(20) > 1.15 * 1.01 * slide(60)


def test_a_drop_gives_way_under_the_needle_and_only_there(microscope: Microscope) -> None:
    x, y = DROP.x / MICRO, DROP.y / MICRO
    free = at(x, y, 12)
    pressed = free._replace(contact=Contact(DROP, 8 * MICRO, (2 * MICRO, 0.0)))
    change = np.abs(luma_of(microscope, pressed) - luma_of(microscope, free))
    assert part(change, x + 8, y + 6, 6).mean() > 8
    assert part(change, x - 80, y + 20, 10).mean() < 4
    on_glass = free._replace(contact=Contact(None, 0.1 * MICRO, (0.0, 0.0)))
    assert np.abs(luma_of(microscope, on_glass) - luma_of(microscope, free)).mean() < 4


def test_the_lens_is_darker_in_its_corners_and_the_light_can_be_turned_down(microscope: Microscope) -> None:
    luma = luma_of(microscope, FAR)
    assert luma[-60:, :60].mean() < 0.75 * luma[200:260, 290:350].mean()
    assert luma_of(microscope, FAR._replace(light=40.0)).mean() < 0.6 * luma.mean()


def test_no_two_pictures_have_the_same_grain(microscope: Microscope) -> None:
    first, second = luma_of(microscope, FAR), luma_of(microscope, FAR)
    assert 0.3 < np.abs(first - second).mean() < 4


def test_steps_and_contact_are_heard() -> None:
    def level(step_rate: float, force: float) -> float:
        sound = Sound()
        return float(np.std(np.frombuffer(b"".join(sound.segment(step_rate, force) for _ in range(20)), "<i2")))

    silence = level(0.0, 0.0)
    assert silence > 0  # the lamp hums
    assert level(1000.0, 0.0) > 3 * silence
    assert level(0.0, 400e-6) > level(0.0, 5e-6) > 2 * silence


def test_segments_join_without_a_click() -> None:
    sound = Sound()
    states = ((0.0, 0.0), (2000.0, 0.0), (500.0, 100e-6), (0.0, 0.0))
    samples = np.frombuffer(b"".join(sound.segment(*state) for state in states), "<i2").astype(int)
    assert len(samples) == 4 * SEGMENT_SAMPLES
    assert np.abs(np.diff(samples)).max() < 2500


@pytest.fixture
def robot() -> Iterator[Micromanipulator]:
    made = Micromanipulator()
    yield made
    made.close()


async def test_no_stamp_is_newer_than_the_truth(robot: Micromanipulator, tmp_path: Path) -> None:
    """By the bridge's own log, and by the event that is drawn into each picture."""
    media: list[Media] = []
    log = tmp_path / "events.jsonl"
    values = [20e-6, 10e-6, -5e-6, 5e-6, 3e-6, -4e-6, 0.0]

    async def receive(bridge: Bridge) -> None:
        async with RobotLink(*bridge.address, "media") as link:
            async for message in link:
                if isinstance(message, Media):
                    media.append(message)

    async with Bridge(robot, BridgeSettings(port=0, event_log=log, event_strip=True)) as bridge, asyncio.timeout(40):
        receiving = asyncio.create_task(receive(bridge))
        async with operator(bridge) as driver:
            while len({medium.stream for medium in media}) < 3 or driver.feedback.event < 40:
                await driver.drive(values)
        receiving.cancel()
        await asyncio.wait([receiving])
    issued = [(line["time"], line["event"]) for line in log_lines(log, "feedback")]
    assert {medium.stream for medium in media} == {MICROSCOPE.name, SIDE.name, MICROPHONE.name}
    for medium in media:
        held = max(event for time, event in issued if time <= medium.time)  # type: ignore[type-var, operator]
        assert medium.stamp == held
        if medium.codec == "yuv420p":
            luma = np.frombuffer(medium.payload, np.uint8)[: medium.width * medium.height]
            assert read_event_strip(luma.reshape(medium.height, medium.width)) == medium.stamp
