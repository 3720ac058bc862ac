"""A map becomes a bounded message, and never shows more room than there is."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.protocol.errors import MessageError
from lockstep.protocol.maps import MAX_CELLS, MAX_MAP_BYTES, OCCUPIED, UNKNOWN, OccupancyMap, map_cells
from lockstep.protocol.messages import decode_message, encode_message
from lockstep.robot_bridge.maps.map_packing import pack_map
from lockstep.robot_bridge.robots.navigation import GridMap


def grid(cells: "np.ndarray[tuple[int, int], np.dtype[np.uint8]]", resolution: float = 0.05) -> GridMap:
    height, width = cells.shape
    return GridMap(width, height, resolution, (-1.0, 2.0, 0.5), cells.tobytes(), 0.0)


def test_a_small_map_travels_as_it_is_and_its_id_names_its_contents() -> None:
    cells = np.array([[0, 100, 255], [50, 0, 0]], np.uint8)
    packed = pack_map(grid(cells))
    assert decode_message(encode_message(packed)) == packed
    assert (packed.width, packed.height, packed.resolution, packed.origin) == (3, 2, 0.05, (-1.0, 2.0, 0.5))
    assert map_cells(packed) == cells.tobytes()
    assert pack_map(grid(cells)).id == packed.id
    cells[0, 0] = 1
    assert pack_map(grid(cells)).id != packed.id
    assert pack_map(grid(cells, 0.1)).id != pack_map(grid(cells)).id


def test_a_map_that_is_too_large_or_does_not_compress_gets_coarser() -> None:
    large = pack_map(grid(np.zeros((3000, 1001), np.uint8)))
    assert (large.width, large.height, large.resolution) == (501, 1500, 0.1)
    noise = np.random.default_rng(1).integers(0, 101, (500, 500)).astype(np.uint8)
    noisy = pack_map(grid(noise))
    assert len(noisy.cells) <= MAX_MAP_BYTES
    assert noisy.resolution > 0.05
    assert noisy.width * noisy.resolution == pytest.approx(500 * 0.05, rel=0.02)


def test_values_that_are_none_are_not_known() -> None:
    assert map_cells(pack_map(grid(np.array([[101, 254, 7]], np.uint8)))) == bytes([UNKNOWN, UNKNOWN, 7])


@pytest.mark.parametrize(("width", "height"), [(3, 2), (2, 0), (-1, 2)])
def test_a_map_that_contradicts_itself_is_refused(width: int, height: int) -> None:
    with pytest.raises(ValueError, match="cells"):
        pack_map(grid(np.zeros((2, 2), np.uint8))._replace(width=width, height=height))


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_a_coarser_map_never_shows_more_room(width: int, height: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    cells = random.choice(np.array([0, 30, 64, 65, 100, 255], np.uint8), (height * 30, width * 30))
    packed = pack_map(grid(cells))
    step = round(packed.resolution / 0.05)
    coarse = np.frombuffer(map_cells(packed), np.uint8).reshape(packed.height, packed.width)
    for row, column in random.integers(0, (height * 30, width * 30), (200, 2)):
        value, shown = cells[row, column], coarse[row // step, column // step]
        if shown < OCCUPIED:
            assert value < OCCUPIED, "an obstacle is hidden"


def test_a_message_is_inflated_no_further_than_it_says() -> None:
    bomb = pack_map(grid(np.zeros((1000, 1000), np.uint8)))
    small = OccupancyMap(id=bomb.id, width=10, height=10, resolution=0.1, cells=bomb.cells)
    for wrong in (small, OccupancyMap(id="", width=1, height=1, resolution=1.0, cells=b"no zlib")):
        with pytest.raises(MessageError):
            map_cells(wrong)
    with pytest.raises(MessageError, match="bound"):
        map_cells(OccupancyMap(id="", width=4096, height=MAX_CELLS // 4096 + 1, resolution=math.pi, cells=b""))


@pytest.mark.parametrize(
    "more", [{"origin": (5e6, 0.0, 0.0)}, {"origin": (math.nan, 0.0, 0.0)}, {"resolution": 0.0}, {"resolution": 2e3}]
)
def test_a_map_whose_place_or_scale_no_console_takes_is_refused_here(more: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="a map w"):
        pack_map(grid(np.zeros((2, 2), np.uint8))._replace(**more))  # type: ignore[arg-type]
