from typing import Literal

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.messages import Media
from lockstep.protocol.serial import MAX_EVENT
from lockstep.robot_bridge.robots.event_strip import (
    CELLS,
    draw_event_strip,
    read_event_strip,
    strip_height,
    with_event_strip,
)
from tests.protocol.strategies import events

sizes = st.sampled_from([(480, 640), (240, 320), (720, 1280), (120, 160), (360, 642)])


def picture(height: int, width: int, event: int) -> npt.NDArray[np.uint8]:
    luma = np.full((height, width), 100, np.uint8)
    draw_event_strip(luma, event)
    return luma


@given(events, sizes)
def test_an_event_is_read_as_it_was_drawn(event: int, size: tuple[int, int]) -> None:
    assert read_event_strip(picture(*size, event)) == event


@given(events, st.integers(0, 2**32 - 1))
def test_an_event_survives_noise_and_blur(event: int, seed: int) -> None:
    luma = picture(240, 320, event).astype(float)
    luma = (luma + np.roll(luma, 1, axis=1) + np.roll(luma, -1, axis=1)) / 3
    luma += np.random.default_rng(seed).normal(0, 25, luma.shape)
    assert read_event_strip(luma) == event


def test_the_cells_are_the_bits_most_significant_first_then_even_parity() -> None:
    luma = picture(480, 640, 0b101)
    cells = luma[strip_height(480) // 2, 10::20]
    assert len(cells) == CELLS
    assert [int(cell) for cell in cells] == [16] * 28 + [235, 16, 235, 16]
    assert (luma[strip_height(480)] == 100).all()


@given(events, st.integers(0, CELLS - 1))
def test_a_single_wrong_cell_is_noticed(event: int, cell: int) -> None:
    luma = picture(240, 320, event)
    columns = luma[: strip_height(240), cell * 10 : cell * 10 + 10]
    columns[:] = 251 - columns
    assert read_event_strip(luma) is None


@pytest.mark.parametrize("grey", [16, 128])
def test_a_picture_without_a_strip_reads_as_none(grey: int) -> None:
    assert read_event_strip(np.full((240, 320), grey, np.uint8)) is None


def test_a_picture_too_small_for_a_strip_reads_as_none() -> None:
    assert read_event_strip(np.full((8, 16), 235, np.uint8)) is None


def test_the_largest_event_fits() -> None:
    assert read_event_strip(picture(240, 320, MAX_EVENT)) == MAX_EVENT


def medium(codec: Literal["yuv420p", "mjpeg"], payload: bytes) -> Media:
    return Media(stream="camera", codec=codec, stamp=77, time=0.0, payload=payload, width=320, height=240)


def test_a_raw_picture_gets_its_stamp_and_keeps_the_rest() -> None:
    drawn = np.frombuffer(with_event_strip(medium("yuv420p", bytes([100]) * (320 * 360))).payload, np.uint8)
    assert read_event_strip(drawn[: 320 * 240].reshape(240, 320)) == 77
    assert set(drawn[320 * strip_height(240) :]) == {100}


@pytest.mark.parametrize("media", [medium("mjpeg", bytes(320 * 240)), medium("yuv420p", b"too short")])
def test_what_is_no_raw_picture_stays_as_it_is(media: Media) -> None:
    assert with_event_strip(media) is media
