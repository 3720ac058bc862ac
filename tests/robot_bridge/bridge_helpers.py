"""A bridge on a free port, robots that remember, and an operator that answers feedback, for tests over real TCP."""

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Protocol, TypeVar

from lockstep.protocol.framing import FrameReader, frame
from lockstep.protocol.maps import OccupancyMap
from lockstep.protocol.messages import (
    Command,
    Feedback,
    Hello,
    LinkMessage,
    LinkRole,
    Refusal,
    Reset,
    decode_message,
    encode_message,
)
from lockstep.protocol.neutral import neutral_values
from lockstep.protocol.serial import FIRST_EVENT, event_after
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.base import MediaSource, Robot
from lockstep.robot_bridge.robots.navigation import GridMap
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot, PlanarState
from lockstep.robot_bridge.settings import BridgeSettings
from tests.waiting import PATIENCE

__all__ = [
    "Addressed",
    "DRIVE",
    "NEUTRAL",
    "Operator",
    "PATIENCE",
    "RawLink",
    "RecordingRobot",
    "log_lines",
    "next_map",
    "operator",
    "raw_link",
    "running_bridge",
]

Kind = TypeVar("Kind", bound=LinkMessage)

RESET_AGAIN = 0.1  # s between two tries to reset a stop that is too new


class Addressed(Protocol):
    """A bridge in this process, or somewhere else."""

    @property
    def address(self) -> tuple[str, int]: ...


DRIVE = [0.4, 0.0, 0.0]
NEUTRAL = [0.0, 0.0, 0.0]


class RecordingRobot(PlanarRobot):
    """Remembers what was applied when, and what was called."""

    def __init__(self, *, media: bool = False, map: bool = False, state: PlanarState | None = None) -> None:
        super().__init__(state)
        self.applied: list[tuple[float, list[float]]] = []
        self.calls: list[str] = []
        self._media = media
        self._has_map = map
        self._ticked = asyncio.Event()

    async def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait until the condition holds after a tick."""
        try:
            async with asyncio.timeout(PATIENCE):
                while not condition():
                    self._ticked.clear()
                    await self._ticked.wait()
        except TimeoutError:
            raise AssertionError(f"never happened: {what}") from None

    def apply(self, values: Sequence[float]) -> None:
        self.applied.append((time.monotonic(), list(values)))
        super().apply(values)
        self._ticked.set()

    def stop(self) -> None:
        self.calls.append("stop")
        super().stop()

    def reset(self) -> None:
        self.calls.append("reset")
        super().reset()

    def close(self) -> None:
        self.calls.append("close")

    def sources(self) -> Sequence[MediaSource]:
        return super().sources() if self._media else ()

    def grid_map(self) -> GridMap | None:
        return super().grid_map() if self._has_map else None


@asynccontextmanager
async def running_bridge(
    robot: Robot | None = None, *, event_log: Path | None = None, first_event: int = FIRST_EVENT
) -> AsyncIterator[Bridge]:
    """Runs a bridge; afterwards no connection and no task of it may be left."""
    settings = BridgeSettings(port=0, event_log=event_log, first_event=first_event)
    async with Bridge(robot or RecordingRobot(), settings) as bridge:
        yield bridge
    assert bridge.links == 0
    others = {task for task in asyncio.all_tasks() if task is not asyncio.current_task()}
    assert not others, f"left behind: {others}"


def log_lines(path: Path, kind: str) -> list[dict[str, object]]:
    """The event log's lines of one kind; read it after the bridge has closed."""
    lines: list[dict[str, object]] = [json.loads(line) for line in path.read_text().splitlines()]
    return [line for line in lines if line["kind"] == kind]


class Operator:
    """An operator link and the newest feedback."""

    def __init__(self, link: RobotLink) -> None:
        self.link = link
        self.feedback = Feedback(event=1, issue=1, time=0.0, axes=[])

    async def next(self, kind: type[Kind]) -> Kind:
        message = await self._next((kind,))
        assert isinstance(message, kind)
        return message

    async def _next(self, kinds: tuple[type[object], ...]) -> LinkMessage:
        async with asyncio.timeout(PATIENCE):
            async for message in self.link:
                if isinstance(message, Feedback):
                    self.feedback = message
                if isinstance(message, kinds):
                    return message
        raise AssertionError("the link was closed")

    def command(self, values: Sequence[float | None] = DRIVE) -> Command:
        newest = self.feedback
        return Command(event=event_after(newest.event), issue=newest.issue, values=values, nonce=newest.nonce)

    async def arm(self) -> None:
        """What has to come before the first moving command."""
        while self.feedback.neutral_needed and not self.feedback.stop.stopped:
            await self.drive(list(self._neutral))

    @property
    def _neutral(self) -> Sequence[float | None]:
        description = self.link.hello.description
        return neutral_values(description.axes) if description is not None else []

    async def drive(self, values: Sequence[float | None] = DRIVE) -> Feedback:
        """Send the next command and wait for its feedback. A bridge that was held up gets its neutral command first."""
        command = self.command(values)
        self.link.send(command)
        while self.feedback.event != command.event:
            message = await self._next((Feedback, Refusal))
            if isinstance(message, Refusal) and (message.event, message.reason) == (command.event, "not_neutral"):
                while not self.feedback.neutral_needed:
                    await self.next(Feedback)
                await self.arm()
                return await self.drive(values)
        return self.feedback

    async def drive_until(self, condition: Callable[[], bool], values: Sequence[float | None] = DRIVE) -> None:
        """Drive until the condition holds, however often a busy machine brings the robot to rest meanwhile."""
        while not condition():
            await self.drive(values)

    async def heard(self, condition: Callable[[Feedback], bool]) -> None:
        """Wait until the newest feedback meets the condition."""
        while not condition(self.feedback):
            await self.next(Feedback)

    async def reset(self, *, by: str = "") -> int:
        """Release the newest stop as soon as the bridge lets it; its number."""
        number = self.feedback.stop.number
        while self.feedback.stop.stopped:
            number = self.feedback.stop.number  # feedback of a newer one may only now be read
            self.link.send(Reset(by=by, number=number))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(RESET_AGAIN):
                    await self.heard(lambda feedback: not feedback.stop.stopped)
        return number

    async def refused(self, message: LinkMessage) -> Refusal:
        self.link.send(message)
        return await self.next(Refusal)


async def next_map(link: RobotLink) -> OccupancyMap:
    """The next map on a media link."""
    async with asyncio.timeout(PATIENCE):
        async for message in link:
            if isinstance(message, OccupancyMap):
                return message
    raise AssertionError("the link ended")


@asynccontextmanager
async def operator(bridge: Addressed, *, armed: bool = True) -> AsyncIterator[Operator]:
    """`armed`: one neutral command was executed."""
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = Operator(link)
        await driver.next(Feedback)
        if armed:
            await driver.arm()
        yield driver


class RawLink:
    """A TCP connection that speaks only when told to."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self.writer = writer
        self._frames = FrameReader(16 << 20)
        self._waiting: list[LinkMessage] = []

    def send(self, *messages: LinkMessage) -> None:
        self.writer.write(b"".join(frame(encode_message(message)) for message in messages))

    async def next(self) -> LinkMessage | None:
        """The next message; None at the end of the stream."""
        async with asyncio.timeout(PATIENCE):
            while not self._waiting:
                data = await self._reader.read(65536)
                if not data:
                    return None
                self._frames.feed(data)
                self._waiting += [decode_message(payload) for payload in self._frames.frames()]
        return self._waiting.pop(0)

    async def find(self, kind: type[Kind]) -> Kind:
        while (message := await self.next()) is not None:
            if isinstance(message, kind):
                return message
        raise AssertionError(f"the stream ended before any {kind.__name__}")


@asynccontextmanager
async def raw_link(bridge: Addressed, role: LinkRole | None = None) -> AsyncIterator[RawLink]:
    """A raw connection, with the handshake done when a role is given."""
    reader, writer = await asyncio.open_connection(*bridge.address)
    link = RawLink(reader, writer)
    try:
        if role is not None:
            link.send(Hello(role=role))
            await link.find(Hello)
        yield link
    finally:
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()
