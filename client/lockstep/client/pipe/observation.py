"""Pairs a robot's state with pictures of the same state, within the tolerance: a row that a dataset may have."""

import asyncio
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.client.console import Console
from lockstep.client.media.media_gate import verdict
from lockstep.client.media.stream import Picture
from lockstep.protocol.messages import Feedback

__all__ = ["NoFreshObservation", "Observation", "Observer", "unfit", "unfit_state"]

REFRESH = 0.5  # s between two feedbacks of a robot that nobody drives


class NoFreshObservation(Exception):
    """No state and pictures that belong together came in time; the text says which were missing."""


class Kept(NamedTuple):
    """A picture that the gate has let through, and when, in s on the loop's clock."""

    picture: Picture
    arrived: float


class Observation(NamedTuple):
    feedback: Feedback
    pictures: list[Picture]  # in the order of the cameras


def unfit(feedback: Feedback | None, kept: Kept | None, tolerance: int, max_age: float, now: float) -> str:
    """Return why a picture cannot stand beside a state; "" if it can. No I/O.

    Args:
        max_age: s that a picture may be old; where no events happen, the gap alone would let a frozen one through
        now: s, on the clock of `Kept.arrived`
    """
    if feedback is None:
        return "no feedback has come"
    if kept is None:
        return "no picture has come"
    if now - kept.arrived > max_age:
        return f"its newest picture is {now - kept.arrived:.2f} s old"
    decided, gap = verdict(feedback.event, kept.picture.stamp, tolerance)
    return "" if decided == "render" else f"its newest picture is {gap} events behind the state"


def unfit_state(feedback: Feedback | None, arrived: float, max_age: float, now: float) -> str:
    """Return why a state is no observation; "" if it is one. No I/O.

    Args:
        arrived: s, when the newest feedback came, on the clock of `now`
        max_age: s that it may be old beyond `REFRESH`
    """
    if feedback is None:
        return "no feedback has come"
    if feedback.unknown:
        return f"the robot does not know {', '.join(feedback.unknown)}"
    if now - arrived > max_age + REFRESH:
        return f"the newest feedback is {now - arrived:.2f} s old"
    return ""


class Observer:
    """Keeps the newest feedback and the newest picture of each camera. `run` runs until cancelled."""

    def __init__(self, console: Console, cameras: Sequence[str], tolerance: int) -> None:
        self._console = console
        self._cameras = list(cameras)
        self._tolerance = tolerance
        self._kept: dict[str, Kept] = {}
        self._arrived = float("-inf")  # s, when the newest feedback came
        self._news = asyncio.Event()

    async def run(self) -> None:
        """Read the console.

        Raises:
            ConsoleLost: the connection ended.
        """
        async with asyncio.TaskGroup() as group:
            group.create_task(self._feedbacks())
            for camera in self._cameras:
                group.create_task(self._pictures(camera))

    async def take(self, seconds: float, max_age: float) -> Observation:
        """Return the newest state with a picture of each camera that belongs to it; wait for one that does.

        Args:
            seconds: s to wait at most
            max_age: s that a picture may be old, and a state beyond the interval in which an idle robot measures

        Raises:
            NoFreshObservation: none came in time, or a part of the state is unknown.
        """
        loop = asyncio.get_running_loop()
        why: dict[str, str] = {}
        try:
            async with asyncio.timeout(seconds):
                while True:
                    self._news.clear()
                    feedback, now = self._console.feedback, loop.time()
                    why = {
                        camera: reason
                        for camera in self._cameras
                        if (reason := unfit(feedback, self._kept.get(camera), self._tolerance, max_age, now))
                    }
                    if reason := unfit_state(feedback, self._arrived, max_age, now):
                        why["state"] = reason
                    if feedback is not None and not why:
                        return Observation(feedback, [self._kept[camera].picture for camera in self._cameras])
                    await self._news.wait()
        except TimeoutError as error:
            words = "; ".join(f"{name}: {reason}" for name, reason in why.items()) or "no feedback has come"
            raise NoFreshObservation(f"no fresh observation within {seconds:g} s: {words}") from error

    async def _feedbacks(self) -> None:
        loop = asyncio.get_running_loop()
        async for _ in self._console.feedbacks():
            self._arrived = loop.time()
            self._news.set()

    async def _pictures(self, camera: str) -> None:
        loop = asyncio.get_running_loop()
        async for picture in self._console.pictures(camera, keep=1):
            self._kept[camera] = Kept(picture, loop.time())
            self._news.set()
