"""A bridge of two axes written from docs/robot-link.md with asyncio's streams, which can be given one fault."""

import asyncio
import contextlib
import math
import secrets
import time
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from enum import Enum, auto

import msgspec

from lockstep.protocol.description import Axis, Camera, RobotDescription
from lockstep.protocol.errors import MessageError
from lockstep.protocol.messages import (
    Command,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    Media,
    Ping,
    Pong,
    Refusal,
    RefusalReason,
    Reset,
    Rest,
    Stop,
    StopState,
    StopTaken,
    decode_message,
    encode_message,
)
from lockstep.protocol.serial import event_after, event_gap

__all__ = ["Fault", "PlainBridge", "running_plain_bridge", "serving"]

TICK = 0.01  # s
HOLD = 0.2  # s
AGE = 0.5  # s
DESCRIPTION = RobotDescription(
    name="plain",
    label="Plain",
    axes=(
        Axis(name="x", label="X", unit="m/s", minimum=-1, maximum=1, slew=100, brake=100),
        Axis(name="y", label="Y", unit="m/s", minimum=-1, maximum=1, slew=100, brake=100),
    ),
    cameras=(Camera(name="camera", label="Camera", width=16, height=16, frame_rate=25),),
    hold=HOLD,
    max_event_age=AGE,
    max_event_rate=100,
)
NEUTRAL = [0.0, 0.0]
PICTURE = bytes(16 * 16 * 3 // 2)
ALLOWED: dict[LinkRole, tuple[type[LinkMessage], ...]] = {
    "operator": (Command, Rest, Stop, Reset),
    "events": (Stop,),
    "media": (Stop,),
}


class Fault(Enum):
    """What the bridge does wrong."""

    REPEATS_HOLD = auto()  # a repeat moves the robot again, and is answered with the same event
    REPEATS_COUNT = auto()  # a repeat executes as the next event
    LATE_EXECUTES = auto()
    UNSEEN_EXECUTES = auto()
    NO_HOLD = auto()  # the last command goes on for ever
    NO_REST = auto()
    NO_NEUTRAL = auto()  # moves at once on a new link
    FORGETS_STOP = auto()  # with the next operator link
    NUMBERS_REPEATS = auto()  # each message of a press is a stop of its own
    RESETS_ANY_STOP = auto()
    NAN_EXECUTES = auto()
    DIES_OF_MALFORMED = auto()
    STAMPS_AHEAD = auto()
    TWO_OPERATORS = auto()
    NO_HEARTBEATS = auto()
    SILENCE_LASTS = auto()  # a link on which nothing comes stays
    NO_BOUND = auto()  # waits for whatever length
    ANY_VERSION = auto()
    ANY_ROLE = auto()  # takes what the role does not permit, and says nothing
    REFUSES_SILENTLY = auto()
    NO_REFRESH = auto()  # measures only when commanded


@dataclass(eq=False)
class Link:
    writer: asyncio.StreamWriter
    role: LinkRole

    def send(self, message: LinkMessage) -> None:
        send(self.writer, message)


@dataclass(eq=False)
class PlainBridge:
    """The state of the robot and of who is there."""

    fault: Fault | None = None
    drawing: float = 0.0  # s from capturing a picture to sending it
    description: RobotDescription = DESCRIPTION
    captured: deque[Media] = field(default_factory=deque)  # and not sent yet
    address: tuple[str, int] = ("127.0.0.1", 0)
    links: set[Link] = field(default_factory=set)
    epoch: str = field(default_factory=lambda: secrets.token_hex(8))
    values: list[float] = field(default_factory=lambda: list(NEUTRAL))
    executed: float = 0.0  # s, when the command was that is held
    event: int = 1
    issue: int = 0
    issues: dict[int, Feedback] = field(default_factory=dict)  # of this event
    neutral_needed: bool = True
    voided: int = 0  # the newest event that a rest voids
    stop: StopState = field(default_factory=lambda: StopState(kept=False))
    presses: dict[str, int] = field(default_factory=dict)
    stopped_at: float = 0.0  # s
    ticks: int = 0

    # The robot

    def tick(self) -> None:
        now = time.monotonic()
        self.ticks += 1
        if now - self.executed > HOLD - TICK and self.fault is not Fault.NO_HOLD:
            self.values = list(NEUTRAL)
        if self.issue == 0 or (now - self.newest.time > 0.5 and self.fault is not Fault.NO_REFRESH):
            self.measure()
        if self.ticks % 20 == 0 and self.fault is not Fault.NO_HEARTBEATS:
            self.tell("operator", Ping(id=self.ticks))
            self.tell("events", Ping(id=self.ticks))
            self.tell("media", Ping(id=self.ticks))
        if self.ticks % 4 == 0:
            stamp = event_after(self.event) if self.fault is Fault.STAMPS_AHEAD else self.event
            self.captured.append(
                Media(stream="camera", codec="yuv420p", stamp=stamp, time=now, payload=PICTURE, width=16, height=16)
            )
        while self.captured and now - self.captured[0].time >= self.drawing:
            self.tell("media", self.captured.popleft())

    @property
    def newest(self) -> Feedback:
        return self.issues[self.issue]

    def measure(self) -> None:
        """Issue the current event's feedback, once more."""
        self.issue += 1
        now = time.monotonic()
        self.issues[self.issue] = Feedback(
            event=self.event,
            issue=self.issue,
            time=now,
            axes=list(self.values),
            at_rest=self.values == NEUTRAL,
            stop=self.stop,
            nonce=secrets.randbelow(2**53 - 1) + 1,
            neutral_needed=self.neutral_needed,
        )
        self.tell("operator", self.newest)
        self.tell("events", EventNotice(event=self.event, time=now))

    def tell(self, role: LinkRole, message: LinkMessage) -> None:
        for link in self.links:
            if link.role == role:
                link.send(message)

    # What clients say

    def take(self, link: Link, message: LinkMessage) -> None:
        match message:
            case Command():
                self.command(link, message)
            case Rest():
                self.rest(message)
            case Stop():
                link.send(StopTaken(press=message.press, number=self.press(message), kept=False))
            case Reset():
                if (refused := self.reset(message)) is not None:
                    link.send(Refusal(event=0, reason=refused, current=self.event, stop=message.number))

    def command(self, link: Link, command: Command) -> None:
        if command.event == self.event and not self.stop.stopped and self.is_proper(command) is None:
            if self.fault is Fault.REPEATS_COUNT:
                command = msgspec.structs.replace(command, event=event_after(self.event))
                self.execute(command)
            elif self.fault is Fault.REPEATS_HOLD:
                self.executed, self.values = time.monotonic(), numbers(command)
                self.tell("operator", self.newest)
            else:
                self.tell("operator", self.newest)
            return
        reason = self.is_proper(command) or self.may_execute(command)
        if reason is None:
            self.execute(command)
            return
        if self.fault is not Fault.REFUSES_SILENTLY:
            link.send(Refusal(event=command.event, reason=reason, current=self.event))
        if reason == "late":
            self.measure()

    def is_proper(self, command: Command) -> RefusalReason | None:
        if len(command.values) != len(NEUTRAL):
            return "wrong_size"
        if not all(map(is_number, command.values)) and self.fault is not Fault.NAN_EXECUTES:
            return "not_a_number"
        return "stopped" if self.stop.stopped else None

    def may_execute(self, command: Command) -> RefusalReason | None:
        if command.event != event_after(self.event):
            return "out_of_order"
        answered = self.issues.get(command.issue)
        is_old = answered is not None and time.monotonic() - answered.time > AGE
        if answered is None or (is_old and self.fault is not Fault.LATE_EXECUTES):
            return "late"
        if command.nonce != answered.nonce and self.fault is not Fault.UNSEEN_EXECUTES:
            return "unseen"
        if command.values == NEUTRAL:
            return None
        if self.voided and event_gap(command.event, self.voided) <= 0:
            return "rested"
        return "not_neutral" if self.neutral_needed and self.fault is not Fault.NO_NEUTRAL else None

    def execute(self, command: Command) -> None:
        self.executed, self.values = time.monotonic(), numbers(command)
        if command.values == NEUTRAL:
            self.neutral_needed = False
            self.presses.clear()
        self.event, self.issue, self.issues = command.event, 0, {}
        self.measure()

    def rest(self, rest: Rest) -> None:
        following = event_after(self.event)
        if event_gap(self.event, rest.event) > 0 or self.fault is Fault.NO_REST:
            return
        self.values = list(NEUTRAL)
        self.voided = following if event_gap(rest.event, following) > 0 else rest.event

    def press(self, stop: Stop) -> int:
        known = self.presses.get(stop.press)
        if stop.press and known is not None and self.fault is not Fault.NUMBERS_REPEATS:
            return known
        number = self.stop.number + 1
        first = self.stop if self.stop.stopped else StopState(by=stop.by, reason=stop.reason)
        self.stop = StopState(True, first.by, first.reason, number, stop.press, kept=False)
        self.presses[stop.press] = number
        self.values, self.neutral_needed, self.stopped_at = list(NEUTRAL), True, time.monotonic()
        self.measure()
        return number

    def reset(self, reset: Reset) -> RefusalReason | None:
        if reset.number != self.stop.number and self.fault is not Fault.RESETS_ANY_STOP:
            return "stale_reset"
        if not self.stop.stopped:
            return None
        if time.monotonic() - self.stopped_at < 1.0:
            return "too_soon"
        self.stop = released(self.stop)
        self.measure()
        return None

    # Links

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        link = None
        try:
            async with asyncio.timeout(2.0) as limit:
                link = await self.admitted(reader, writer)
                while link is not None:
                    if self.fault is not Fault.SILENCE_LASTS:
                        limit.reschedule(asyncio.get_running_loop().time() + 1.0)
                    else:
                        limit.reschedule(None)
                    if not await self.heard(reader, link):
                        break
        except TimeoutError:
            send(writer, Goodbye(error="silent"))
        except (ConnectionError, asyncio.IncompleteReadError):
            pass
        finally:
            if link is not None:
                self.links.discard(link)
                if link.role == "operator":
                    self.values, self.neutral_needed = list(NEUTRAL), True
            with contextlib.suppress(ConnectionError):
                writer.close()
                await writer.wait_closed()

    async def admitted(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Link | None:
        payload = await self.payload(reader, writer, 8 << 10)
        if payload is None:
            return None
        try:
            hello = decode_message(payload)
        except MessageError:
            hello = Pong(id=0)
        if not isinstance(hello, Hello):
            send(writer, Goodbye(error="handshake"))
            return None
        if hello.version != 2 and self.fault is not Fault.ANY_VERSION:
            send(writer, Goodbye(error="version"))
            return None
        if hello.role not in ALLOWED:
            send(writer, Goodbye(error="role"))
            return None
        is_taken = hello.role == "operator" and any(link.role == "operator" for link in self.links)
        if is_taken and self.fault is not Fault.TWO_OPERATORS:
            send(writer, Goodbye(error="taken"))
            return None
        described = None if hello.role == "events" else self.description
        send(writer, Hello(role="robot", epoch=self.epoch, description=described))
        link = Link(writer, hello.role)
        self.links.add(link)
        if hello.role == "operator":
            self.neutral_needed = True
            if self.fault is Fault.FORGETS_STOP:
                self.stop = released(self.stop)
        self.measure()
        return link

    async def heard(self, reader: asyncio.StreamReader, link: Link) -> bool:
        """One valid message; False when the link is over."""
        while (payload := await self.payload(reader, link.writer, 1 << 20)) is not None:
            try:
                message = decode_message(payload)
            except MessageError:
                if self.fault is Fault.DIES_OF_MALFORMED:
                    for each in self.links:
                        each.writer.close()
                    return False
                link.send(Refusal(event=0, reason="malformed", current=self.event))
                continue
            match message:
                case Goodbye():
                    return False
                case Ping():
                    link.send(Pong(id=message.id))
                    return True
                case Pong():
                    return True
            if isinstance(message, ALLOWED[link.role]):
                self.take(link, message)
                return True
            if self.fault is not Fault.ANY_ROLE:
                event = message.event if isinstance(message, Command) else 0
                link.send(Refusal(event=event, reason="not_allowed", current=self.event))
        return False

    async def payload(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, bound: int) -> bytes | None:
        length = int.from_bytes(await reader.readexactly(4), "big")
        if not 0 < length <= bound and self.fault is not Fault.NO_BOUND:
            send(writer, Goodbye(error="framing"))
            return None
        return await reader.readexactly(length)


def is_number(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def numbers(command: Command) -> list[float]:
    """The values; this robot has no goal axes, for which null would be one."""
    return [value for value in command.values if value is not None]


def released(stop: StopState) -> StopState:
    return StopState(number=stop.number, press=stop.press, kept=False)


def send(writer: asyncio.StreamWriter, message: LinkMessage) -> None:
    payload = encode_message(message)
    if not writer.is_closing():
        writer.write(len(payload).to_bytes(4, "big") + payload)


@asynccontextmanager
async def running_plain_bridge(fault: Fault | None = None, drawing: float = 0.0) -> AsyncIterator[PlainBridge]:
    bridge = PlainBridge(fault, drawing)
    async with serving(bridge):
        yield bridge


@asynccontextmanager
async def serving(bridge: PlainBridge) -> AsyncIterator[None]:
    loop = asyncio.get_running_loop()
    timers: list[asyncio.TimerHandle] = []

    def tick() -> None:
        bridge.tick()
        timers[:] = [loop.call_later(TICK, tick)]

    server = await asyncio.start_server(bridge.serve, "127.0.0.1", 0)
    bridge.address = server.sockets[0].getsockname()
    tick()
    try:
        yield
    finally:
        timers[0].cancel()
        server.close()
        for link in list(bridge.links):
            link.writer.close()
        await server.wait_closed()
