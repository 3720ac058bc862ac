"""What Video4Linux says: microseconds of the kernel's monotonic clock, which Python's is too.

There is no such device where the tests run, so packets of a film are given the times that its driver gives.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import pytest

from lockstep.server.media.sources import picture_source
from lockstep.server.media.sources.opening import kernel_time
from lockstep.server.media.sources.picture_source import read_pictures
from lockstep.server.media.sources.source_url import SourceSpec, parse_source
from lockstep.server.media.sources.source_wire import Captured
from tests.server.media.sources.media_files import film

MICROSECONDS = Fraction(1, 1_000_000)  # of V4L2's stream
LATENCY = 0.05  # s, of a v4l2 source unless set


@pytest.mark.parametrize(
    ("stamped", "known"),
    [
        (100.0, True),
        (99.97, True),
        (90.5, True),
        (89.0, False),
        (100.001, False),
        (1_700_000_000.0, False),
        (0.0, False),
    ],
)
def test_a_time_is_the_kernels_only_if_it_can_be_of_its_monotonic_clock(stamped: float, known: bool) -> None:
    assert kernel_time(stamped, 100.0) == (stamped if known else None)
    assert kernel_time(None, 100.0) is None


class Device:
    """A film whose packets come as a driver's: stamped `age` before they are handed over."""

    def __init__(self, container: Any, age: float, clock: Any) -> None:
        self.streams = container.streams
        self.stamps: list[float] = []
        self._container = container
        self._age = age
        self._clock = clock

    def demux(self, stream: Any) -> Iterator[Any]:
        for packet in self._container.demux(stream):
            if packet.size:
                packet.time_base = MICROSECONDS
                packet.pts = packet.dts = round((self._clock() - self._age) * 1_000_000)
                self.stamps.append(packet.pts / 1_000_000)
            yield packet


def read(path: Path, age: float, clock: Any, monkeypatch: pytest.MonkeyPatch) -> tuple[list[float], list[Captured]]:
    devices: list[Device] = []
    captured: list[Captured] = []

    @contextmanager
    def opened(spec: SourceSpec) -> Iterator[Device]:
        with av.open(str(path)) as container:
            devices.append(Device(container, age, clock))
            yield devices[-1]

    monkeypatch.setattr(picture_source, "opened", opened)
    with suppress(StopIteration):
        read_pictures(parse_source("video", "v4l2:/dev/video0"), lambda _: None, captured.append)
    return devices[0].stamps, captured


@pytest.mark.parametrize(("name", "codec"), [("film.avi", "mjpeg"), ("film.mp4", "libx264"), ("film.mkv", "libvpx")])
def test_a_picture_was_captured_when_the_kernel_says_less_the_latency(
    tmp_path: Path, name: str, codec: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Passed on as H.264 or JPEG, or decoded here: however late it is read."""
    stamps, captured = read(film(tmp_path / name, codec, count=12), 0.2, time.monotonic, monkeypatch)
    assert len(captured) >= 10
    assert [medium.time for medium in captured] == pytest.approx([stamp - LATENCY for stamp in stamps], abs=1e-5)
    assert all(medium.time < time.monotonic() - 0.2 for medium in captured)


def test_a_driver_that_stamps_by_the_wall_clock_is_placed_by_arrival_and_never_too_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(picture_source, "SETTLE", 0.0)
    _, captured = read(film(tmp_path / "film.avi", "mjpeg", count=12), 0.0, time.time, monkeypatch)
    assert captured
    assert all(medium.time <= time.monotonic() - LATENCY for medium in captured)
