"""Feeds the live checks of episodes from the session: the robot's cameras, what is recorded, and the recorder."""

import time
from collections.abc import Callable, Mapping
from typing import Protocol

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeProblem
from lockstep.server.recording.episodes.live_checks import LiveChecks, RecorderFigures
from lockstep.server.recording.episodes.open_episode import OpenEpisode
from lockstep.server.recording.writing.recorder import Recorder

__all__ = ["CheckedRobot", "SessionChecks"]


class CheckedRobot(Protocol):
    """The part of the connection to the robot that is needed here."""

    @property
    def description(self) -> RobotDescription | None: ...


class SessionChecks:
    """Call `begin` with each episode, `picture` with each recorded picture, and `look` about twice a second.

    Attributes:
        problems: of the open episode, as the last `look` found them
    """

    def __init__(
        self, robot: CheckedRobot, recorder: Recorder, recorded: Callable[[], Mapping[str, str]], keeps_free: int
    ) -> None:
        """`recorded`: codec by stream of what is recorded; `keeps_free`: bytes that are to stay free on the disk."""
        self._robot = robot
        self._recorder = recorder
        self._recorded = recorded
        self._keeps_free = keeps_free
        self._checks = LiveChecks()
        self.problems: list[EpisodeProblem] = []

    def begin(self, event: int) -> None:
        self.problems = []
        described = () if self._robot.description is None else self._robot.description.cameras
        rates = {camera.name: camera.frame_rate for camera in described}
        cameras = {
            stream: rates.get(stream, 0.0) for stream, codec in self._recorded().items() if codec in ("H264", "VP8")
        }
        self._checks.begin(cameras, event, self._figures().lost, time.monotonic())

    def picture(self, stream: str, stamp: int) -> None:
        self._checks.picture(stream, stamp, time.monotonic())

    def look(self, event: int, episode: OpenEpisode) -> bool:
        """Remember in `episode` what spoils it. Return True if that is something else than at the last look."""
        before = {(each.kind, each.stream) for each in self.problems}
        self.problems = self._checks.problems(event, self._figures(), time.monotonic())
        for each in self.problems:
            episode.spoiled(f"{each.kind} {each.stream}".strip())
        return before != {(each.kind, each.stream) for each in self.problems}

    def _figures(self) -> RecorderFigures:
        thread = self._recorder.running
        if thread is None:
            return RecorderFigures(0, 0.0, 0, 0)
        return RecorderFigures(thread.queue.lost, thread.queue.waiting, thread.parts.free_bytes, self._keeps_free)
