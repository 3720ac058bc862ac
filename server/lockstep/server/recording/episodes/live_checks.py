"""Finds at once what spoils an episode while it is recorded. No I/O; the caller hands in `now`, in s."""

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

from lockstep.protocol.episodes import EpisodeProblem
from lockstep.protocol.serial import event_gap

__all__ = ["LiveChecks", "RecorderFigures"]

MISSING_SECONDS = 1.0  # without a picture
RATE_SECONDS = 3.0  # over which the rate of pictures is measured
RATE_SHARE = 0.5  # of the described rate
FEW = 6  # pictures in that time: a camera that gives fewer has no rate that could be measured
TOLERANCE = 4  # events, as the page's own
BEHIND_SECONDS = 0.5  # for which a camera has to lag: one late picture is no trouble
IDLE_SECONDS = 10.0  # without an event
FULL_SHARE = 0.25  # of the recorder's queue
DISK_MARGIN = 1.25  # of the room that is to stay free


class RecorderFigures(NamedTuple):
    """The recorder's figures."""

    lost: int  # records that were left out, ever
    waiting: float  # share of its queue that is taken, 0 to 1
    free_bytes: int  # on the disk; 0: not known
    keeps_free: int  # bytes that are to stay free; with less the recording ends


class _Camera:
    def __init__(self, rate: float, now: float) -> None:
        self.rate = rate  # Hz, as described; 0: not known
        self.newest_at = now
        self.stamp = 0  # of the newest picture; 0: none yet
        self.behind_since: float | None = None
        self.times: deque[float] = deque(maxlen=256)

    def rate_now(self, now: float) -> float:
        return sum(1 for each in self.times if now - each <= RATE_SECONDS) / RATE_SECONDS


class LiveChecks:
    """Call `begin` with each episode, `picture` with each recorded picture, and `problems` about twice a second."""

    def __init__(self) -> None:
        self._cameras: dict[str, _Camera] = {}
        self._began = 0.0
        self._lost_before = 0
        self._event = 0
        self._event_at = 0.0

    def begin(self, cameras: Mapping[str, float], event: int, lost: int, now: float) -> None:
        """Begin with an episode. `cameras`: the described rate (Hz) of each that is recorded; 0 where none is known."""
        self._cameras = {stream: _Camera(rate, now) for stream, rate in cameras.items()}
        self._began, self._lost_before = now, lost
        self._event, self._event_at = event, now

    def picture(self, stream: str, stamp: int, now: float) -> None:
        camera = self._cameras.get(stream)
        if camera is not None:
            camera.newest_at, camera.stamp = now, stamp
            camera.times.append(now)

    def problems(self, event: int, recorder: RecorderFigures, now: float) -> list[EpisodeProblem]:
        """Return what spoils the episode now, or has spoilt it."""
        if event != self._event:
            self._event, self._event_at = event, now
        found = [
            problem
            for stream, camera in self._cameras.items()
            if (problem := self._camera_problem(stream, camera, event, now)) is not None
        ]
        if now - self._event_at >= IDLE_SECONDS:
            text = f"nobody has driven for {now - self._event_at:.0f} s"
            found.append(EpisodeProblem(kind="no_events", text=text))
        lost = recorder.lost - self._lost_before
        if lost > 0:
            found.append(EpisodeProblem(kind="records_lost", text=f"{lost} records are missing: the disk is too slow"))
        elif recorder.waiting >= FULL_SHARE:
            text = f"the disk is too slow: {recorder.waiting:.0%} of the recorder's queue is taken"
            found.append(EpisodeProblem(kind="recorder_behind", text=text))
        if recorder.free_bytes and recorder.free_bytes < recorder.keeps_free * DISK_MARGIN:
            left = max(0.0, (recorder.free_bytes - recorder.keeps_free) / 1e6)
            text = f"the disk is almost full: {left:.0f} MB until the recording ends"
            found.append(EpisodeProblem(kind="disk_low", text=text))
        return found

    def _camera_problem(self, stream: str, camera: _Camera, event: int, now: float) -> EpisodeProblem | None:
        silence = now - camera.newest_at
        slowest = 3.0 / camera.rate if camera.rate else 0.0
        if silence >= max(MISSING_SECONDS, slowest):
            return EpisodeProblem(
                kind="camera_missing", stream=stream, text=f"{stream}: no picture for {silence:.0f} s"
            )
        gap = event_gap(event, camera.stamp) if camera.stamp else 0
        if gap <= TOLERANCE:
            camera.behind_since = None
        elif camera.behind_since is None:
            camera.behind_since = now
        elif now - camera.behind_since >= BEHIND_SECONDS:
            return EpisodeProblem(kind="camera_behind", stream=stream, text=f"{stream}: {gap} events behind")
        rate = camera.rate_now(now)
        if camera.rate * RATE_SECONDS >= FEW and now - self._began >= RATE_SECONDS and rate < RATE_SHARE * camera.rate:
            text = f"{stream}: {rate:.0f} pictures a second instead of {camera.rate:.0f}"
            return EpisodeProblem(kind="camera_slow", stream=stream, text=text)
        return None
