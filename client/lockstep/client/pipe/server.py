"""Answers requests on a pipe with a console: connect, observe, drive, rest. One request at a time."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from contextlib import AsyncExitStack
from typing import Any

import msgspec

from lockstep.client.console import Console
from lockstep.client.errors import ConsoleError, ConsoleLost, Refused
from lockstep.client.media.stream import Picture
from lockstep.client.pipe.action_axes import action_axes, without_doubles
from lockstep.client.pipe.observation import NoFreshObservation, Observer
from lockstep.client.pipe.reach import within_reach
from lockstep.protocol.pipe.pipe_frames import BadFrame, read_request, to_frame

__all__ = ["PipeServer"]


AHEAD = 4  # requests that may wait for their answers
MAX_CAMERAS = 12  # a console takes 16 media sections

_logger = logging.getLogger(__name__)

Answer = tuple[dict[str, Any], list[bytes | memoryview]]


class Open(msgspec.Struct, forbid_unknown_fields=True, tag_field="do", tag="open"):
    """Connect. The answer describes the robot."""

    link: str
    name: str = "lerobot"
    tolerance: int = 4
    tls_ca: str | None = None
    pictures: bool = True
    connect_seconds: float = 30.0


class TakeSeat(msgspec.Struct, forbid_unknown_fields=True, tag_field="do", tag="take_seat"):
    """Take the seat and arm."""


class Observe(msgspec.Struct, forbid_unknown_fields=True, tag_field="do", tag="observe"):
    """Return a state and the pictures that belong to it, each height x width x 3, RGB."""

    seconds: float = 2.0
    max_age: float = 0.5


class Drive(msgspec.Struct, forbid_unknown_fields=True, tag_field="do", tag="drive"):
    """Send one event. With `wait` the answer comes with its feedback; without, the newest values win."""

    values: dict[str, float]
    wait: bool = True


class ComeToRest(msgspec.Struct, forbid_unknown_fields=True, tag_field="do", tag="rest"):
    """Bring the robot to rest."""


Request = Open | TakeSeat | Observe | Drive | ComeToRest


class NotOpen(Exception):
    """The first request has to be `open`, and the only one."""


class PipeServer:
    """Serves one pipe until it ends; then the console is left, which brings the robot to rest and gives the seat back.

    Use it as an async context manager around `serve`.
    """

    def __init__(
        self, reader: asyncio.StreamReader, write: Callable[[list[bytes | memoryview]], Awaitable[None]]
    ) -> None:
        self._reader = reader
        self._write = write
        self._stack = AsyncExitStack()
        self._console: Console | None = None
        self._observer: Observer | None = None
        self._cameras: dict[str, tuple[int, int]] = {}  # width and height by name
        self._tasks: asyncio.TaskGroup = asyncio.TaskGroup()
        self._driving: asyncio.Task[None] | None = None  # of the newest command that nobody waits for
        self._driving_error: Exception | None = None  # of such a command
        self._watching: asyncio.Task[None] | None = None
        self._watching_error: Exception | None = None  # that ended it

    async def __aenter__(self) -> "PipeServer":
        await self._stack.enter_async_context(self._tasks)
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in (self._driving, self._watching):
            if task is not None:
                task.cancel()
                await asyncio.wait([task])
        await self._stack.aclose()

    async def serve(self) -> None:
        """Answer until the pipe ends. Its end also ends a request that is being answered.

        Raises:
            BadFrame: the other side does not speak in frames, or asks without waiting for answers.
        """
        requests: asyncio.Queue[dict[str, Any]] = asyncio.Queue(AHEAD)
        try:
            async with asyncio.TaskGroup() as tasks:
                answering = tasks.create_task(self._answer_all(requests), name="answers")
                await self._read_all(requests)
                answering.cancel()
        except BaseExceptionGroup as errors:
            raise errors.exceptions[0] from errors

    async def _read_all(self, requests: asyncio.Queue[dict[str, Any]]) -> None:
        while (said := await read_request(self._reader)) is not None:
            if requests.full():
                raise BadFrame(f"more than {AHEAD} requests without their answers")
            requests.put_nowait(said)

    async def _answer_all(self, requests: asyncio.Queue[dict[str, Any]]) -> None:
        while True:
            said = await requests.get()
            try:
                answer, blocks = await self._answer(msgspec.convert(said, Request))
            except Refused as error:
                answer, blocks = {"error": type(error).__name__, "reason": error.reason, "text": str(error)}, []
            except (ConsoleError, NoFreshObservation, NotOpen, msgspec.ValidationError, ValueError) as error:
                answer, blocks = {"error": type(error).__name__, "text": str(error)}, []
            await self._write(to_frame(answer, blocks))

    async def _answer(self, request: Request) -> Answer:
        match request:
            case Open():
                return await self._open(request)
            case TakeSeat():
                await self._connected().take_seat()
            case Observe():
                return await self._observe(request)
            case Drive():
                return await self._drive(request)
            case ComeToRest():
                await self._end_driving()
                await self._connected().rest()
        return {}, []

    async def _open(self, request: Open) -> Answer:
        if self._console is not None:
            raise NotOpen("open already")
        console = Console(
            request.link,
            name=request.name,
            tolerance=request.tolerance,
            tls_ca=request.tls_ca,
            video=MAX_CAMERAS if request.pictures else False,
            audio=False,
            connect_seconds=request.connect_seconds,
        )
        self._console = await self._stack.enter_async_context(console)
        description = console.description
        cameras = description.cameras if request.pictures else ()
        self._cameras = {camera.name: (camera.width, camera.height) for camera in cameras}
        self._observer = Observer(console, list(self._cameras), request.tolerance)
        self._watching = self._tasks.create_task(self._watch(self._observer), name="observer")
        actions = action_axes(description)
        return {
            "robot": description.name,
            "axes": [
                {"name": axis.name, "kind": axis.kind, "unit": axis.unit, "minimum": axis.minimum}
                | {"maximum": axis.maximum, "action": axis.name in actions}
                for axis in description.axes
            ],
            "cameras": [{"name": name, "width": size[0], "height": size[1]} for name, size in self._cameras.items()],
        }, []

    async def _observe(self, request: Observe) -> Answer:
        console = self._connected()
        assert self._observer is not None  # made with the console
        found = await self._observer.take(request.seconds, request.max_age)
        blocks: list[bytes | memoryview] = [
            _pixels(picture, *self._cameras[picture.stream]) for picture in found.pictures
        ]
        feedback = found.feedback
        names = [axis.name for axis in console.description.axes]
        goals = feedback.goals or [None] * len(names)
        return {
            "event": feedback.event,
            "values": dict(zip(names, feedback.axes, strict=True)),
            "goals": dict(zip(names, goals, strict=True)),
            "stamps": [picture.stamp for picture in found.pictures],
            "at_rest": feedback.at_rest,
            "stopped": feedback.stop.stopped,
        }, blocks

    async def _drive(self, request: Drive) -> Answer:
        console = self._connected()
        self._raise_failed()
        newest = console.feedback
        wanted = without_doubles(console.description, request.values)
        measured, applied = ([], []) if newest is None else (newest.axes, newest.goals)
        values = within_reach(console.description.axes, measured, applied, wanted)
        if request.wait:
            await self._end_driving()
            feedback = await console.drive(values)
            return {"sent": values, "event": feedback.event}, []
        if self._driving is not None:
            self._driving.cancel()  # its values are overtaken; what was sent stays sent
        self._driving = self._tasks.create_task(self._drive_on(console, values), name="driving")
        await asyncio.sleep(0)  # the command is on its way, if the gate is open
        return {"sent": values, "event": None}, []

    async def _end_driving(self) -> None:
        if self._driving is not None:
            self._driving.cancel()
            await asyncio.wait([self._driving])
            self._driving = None

    async def _drive_on(self, console: Console, values: Mapping[str, float | None]) -> None:
        try:
            await console.drive(values)
        except Exception as error:  # of a task that nobody awaits: the next request raises it
            _logger.info("driving ended: %s", error)
            self._driving_error = error

    async def _watch(self, observer: Observer) -> None:
        try:
            await observer.run()
        except Exception as error:  # of a task that nobody awaits: the next request raises it
            _logger.info("observing ended: %s", error)
            self._watching_error = error

    def _raise_failed(self) -> None:
        """A command that nobody waited for may have been refused."""
        error, self._driving_error = self._driving_error, None
        if error is not None:
            raise error

    def _connected(self) -> Console:
        if self._console is None:
            raise NotOpen("open comes first")
        if self._watching is not None and self._watching.done() and not self._watching.cancelled():
            error: BaseException | None = self._watching_error
            while isinstance(error, BaseExceptionGroup):
                error = error.exceptions[0]
            raise error if isinstance(error, ConsoleError) else ConsoleLost("the connection ended")
        return self._console


def _pixels(picture: Picture, width: int, height: int) -> bytes:
    """Return the pixels in the camera's own size: the console may have sent fewer for a narrow network."""
    frame = picture.frame.reformat(width=width, height=height, format="rgb24")
    return frame.to_ndarray().tobytes()
