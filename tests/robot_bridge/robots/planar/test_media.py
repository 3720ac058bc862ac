import asyncio
import itertools

import numpy as np
import numpy.typing as npt
import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.base import MediaSource, Stamp
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION, FRONT, MICROPHONE, OVERVIEW
from lockstep.robot_bridge.robots.planar.drawing import FrontDrawing, OverviewDrawing
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot, PlanarState
from lockstep.robot_bridge.robots.planar.sound import SEGMENT_SAMPLES, TONE_HZ, Synthesiser
from tests.robot_bridge.robots.stamping import Stamping

EVENT = 123_456_789


def luma(picture: bytes, width: int, height: int) -> npt.NDArray[np.uint8]:
    return np.frombuffer(picture, np.uint8)[: width * height].reshape(height, width)


async def capture(source: MediaSource, count: int) -> list[Media]:
    """The first media of a source whose stamp counts up at each capture."""
    counter = itertools.count(EVENT)
    loop = asyncio.get_running_loop()
    media: list[Media] = []
    enough = asyncio.Event()

    def emit(medium: Media) -> None:
        media.append(medium)
        if len(media) >= count:
            enough.set()

    running = asyncio.ensure_future(source.run(Stamping(lambda: Stamp(next(counter), loop.time())), emit))
    try:
        async with asyncio.timeout(20):
            await enough.wait()
    finally:
        running.cancel()
        await asyncio.wait([running])
    return media


@pytest.mark.parametrize("drawing", [OverviewDrawing, FrontDrawing])
@pytest.mark.parametrize(("width", "height"), [(640, 480), (320, 240)])
def test_a_picture_is_yuv420p_and_carries_its_event(
    drawing: type[OverviewDrawing | FrontDrawing], width: int, height: int
) -> None:
    picture = drawing(width, height).draw(PlanarState(fx=-30.0), EVENT)
    assert len(picture) == width * height * 3 // 2
    assert read_event_strip(luma(picture, width, height)) == EVENT


@pytest.mark.parametrize("drawing", [OverviewDrawing(640, 480), FrontDrawing(320, 240)])
@pytest.mark.parametrize("change", [{"x": 0.5}, {"y": -0.5}, {"yaw": 0.5}])
def test_the_picture_shows_the_state(drawing: OverviewDrawing | FrontDrawing, change: dict[str, float]) -> None:
    assert drawing.draw(PlanarState(), 1) != drawing.draw(PlanarState()._replace(**change), 1)


def test_the_overview_shows_contact() -> None:
    drawing = OverviewDrawing(640, 480)
    assert drawing.draw(PlanarState(), 1) != drawing.draw(PlanarState(fx=-50.0), 1)


@pytest.mark.parametrize(
    "state", [PlanarState(x=3.7, y=2.7), PlanarState(x=-3.7, y=-2.7, yaw=3.0), PlanarState(x=3.7, yaw=1.5707963)]
)
def test_pictures_at_the_walls_and_in_corners_are_whole(state: PlanarState) -> None:
    assert len(OverviewDrawing(640, 480).draw(state, 1)) == 460_800
    assert len(FrontDrawing(320, 240).draw(state, 1)) == 115_200


def test_speed_is_heard_and_the_tone_is_always_there() -> None:
    def spectrum(speed: float) -> npt.NDArray[np.float64]:
        synthesiser = Synthesiser()
        samples = b"".join(synthesiser.segment(speed) for _ in range(50))
        return np.abs(np.fft.rfft(np.frombuffer(samples, "<i2").astype(float)))

    standing, moving = spectrum(0.0), spectrum(0.8)
    assert int(standing.argmax()) == round(TONE_HZ)  # one second: bins of 1 Hz
    assert moving[round(TONE_HZ)] == pytest.approx(standing[round(TONE_HZ)], rel=0.2)
    assert moving.max() > 2 * standing.max()


def test_segments_join_without_a_click() -> None:
    synthesiser = Synthesiser()
    sound = np.frombuffer(b"".join(synthesiser.segment(speed) for speed in (0.0, 0.8, 0.2)), "<i2").astype(int)
    assert len(sound) == 3 * SEGMENT_SAMPLES
    assert np.abs(np.diff(sound)).max() < 1500


async def test_the_cameras_stamp_at_capture_and_name_themselves() -> None:
    for camera, source in zip((OVERVIEW, FRONT), PlanarRobot().sources(), strict=False):
        media = await capture(source, 2)
        assert [medium.stamp for medium in media] == [EVENT, EVENT + 1]
        for medium in media:
            assert (medium.stream, medium.codec) == (camera.name, "yuv420p")
            assert (medium.width, medium.height) == (camera.width, camera.height)
            assert read_event_strip(luma(medium.payload, medium.width, medium.height)) == medium.stamp
        assert camera in DESCRIPTION.cameras


async def test_the_microphone_stamps_a_segment_at_its_start() -> None:
    now = asyncio.get_running_loop().time()
    media = await capture(PlanarRobot().sources()[2], 3)
    assert [medium.stamp for medium in media] == [EVENT, EVENT + 1, EVENT + 2]
    assert media[0].time - now < 0.02
    for medium in media:
        assert len(medium.payload) == 2 * SEGMENT_SAMPLES
        assert (medium.sample_rate, medium.channels) == (48_000, 1)
        assert medium.stream == MICROPHONE.name
