"""A robot of two axes, written from docs/robot-link.md and from nothing else, which can be given one fault.

It reads and writes plain maps, and imports nothing of Lockstep's (test_plain_bridge.py): a page that says something
else than Lockstep does makes it fail. It has two actions. It leaves out what the page lets a bridge leave out (goal
axes, a secret, TLS, a start warning, encoding, a disk), `max_event_rate`, which its clients keep, and the watchdog.
"""

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
from typing import Any

from tests.robot_bridge.conformance.plain_actions import PlainActions, RobotNow
from tests.robot_bridge.conformance.plain_messages import (
    LARGEST,
    Malformed,
    Message,
    event_after,
    event_gap,
    frame,
    read,
)

__all__ = ["AGE", "NEUTRAL", "TICK", "Fault", "Link", "PlainBridge", "running_plain_bridge", "serving"]

TICK = 0.01  # s
HOLD = 0.2  # s
AGE = 0.5  # s
GRACE = 10.0  # s for which the robot is reserved for an operator whose link broke
PRESSES = 256  # that are known
RATE_AXIS = {"unit": "m/s", "minimum": -1, "maximum": 1, "slew": 100, "brake": 100}
DESCRIPTION: Message = {
    "name": "plain",
    "label": "Plain",
    "axes": [{"name": "x", "label": "X", **RATE_AXIS}, {"name": "y", "label": "Y", **RATE_AXIS}],
    "joints": [{"name": "place.x", "unit": "m"}, {"name": "place.y", "unit": "m"}],
    "cameras": [{"name": "camera", "label": "Camera", "width": 16, "height": 16, "frame_rate": 25}],
    "actions": [
        {"name": "home", "label": "Home"},
        {
            "name": "light",
            "label": "Light",
            "moves": False,
            "parameters": [{"name": "on", "label": "On", "kind": "switch", "default": True}],
        },
    ],
    "hold": HOLD,
    "max_event_age": AGE,
    "max_event_rate": 100,
}
NEUTRAL = [0.0, 0.0]
AWAY = [1.0, 0.0]  # m from home, where it begins: further than any case lets it go
HOMING_SPEED = 0.1  # m/s
NEAR = 0.01  # m from home
PICTURE = bytes(16 * 16 * 3 // 2)
ALLOWED = {
    "operator": ("command", "rest", "stop", "reset", "act", "action_cancel"),
    "events": ("stop",),
    "media": ("stop",),
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
    ACTS_UNRENEWED = auto()  # an action goes on without armed events
    ACTS_AGAIN = auto()  # a repeat of a request that was cancelled begins it again
    ACTS_UNARMED = auto()  # an action moves the robot at once on a new link
    ACTS_DRIVEN = auto()  # an action goes on when a moving command comes
    ACTS_DRIVEN_ON = auto()  # and one that is not renewed ends late


@dataclass(eq=False)
class Link:
    writer: asyncio.StreamWriter
    role: str
    name: str = ""
    left: bool = False  # said goodbye

    def send(self, message: Message) -> None:
        send(self.writer, message)


@dataclass(eq=False)
class PlainBridge:
    """The state of the robot and of who is there."""

    fault: Fault | None = None
    drawing: float = 0.0  # s from capturing a picture to sending it
    description: Message = field(default_factory=lambda: DESCRIPTION)
    captured: deque[Message] = field(default_factory=deque)  # and not sent yet
    address: tuple[str, int] = ("127.0.0.1", 0)
    links: set[Link] = field(default_factory=set)
    reserved: tuple[str, float] = ("", 0.0)  # for whom, and until when, s
    epoch: str = field(default_factory=lambda: secrets.token_hex(8))
    place: list[float] = field(default_factory=lambda: list(AWAY))  # m
    light: bool = False
    values: list[float] = field(default_factory=lambda: list(NEUTRAL))
    executed: float = 0.0  # s, when the command was that is held
    event: int = 1
    issue: int = 0
    issues: dict[int, Message] = field(default_factory=dict)  # of this event
    neutral_needed: bool = True
    voided: int = 0  # the newest event that a rest voids
    stop: Message = field(default_factory=lambda: {"stopped": False, "number": 0, "press": "", "kept": False})
    presses: dict[str, int] = field(default_factory=dict)
    stopped_at: float = 0.0  # s
    ticks: int = 0

    def __post_init__(self) -> None:
        self.actions = PlainActions(
            self.description.get("actions", []),
            self.description["max_event_age"],
            lambda state: self.tell("operator", state),
            begins_anew=self.fault is Fault.ACTS_AGAIN,
            needs_neutral=self.fault is not Fault.ACTS_UNARMED,
        )

    # The robot

    def tick(self) -> None:
        now = time.monotonic()
        self.ticks += 1
        if now - self.executed > HOLD - TICK and self.fault is not Fault.NO_HOLD and not self.actions.moving:
            self.values = list(NEUTRAL)
        self.act(now)
        self.place = [place + value * TICK for place, value in zip(self.place, self.values, strict=True)]
        if self.issue == 0 or (now - self.newest["time"] > 0.5 and self.fault is not Fault.NO_REFRESH):
            self.measure()
        if self.ticks % 20 == 0 and self.fault is not Fault.NO_HEARTBEATS:
            for role in ALLOWED:
                self.tell(role, {"type": "ping", "id": self.ticks})
        if self.ticks % 4 == 0:
            self.captured.append(self.picture(now))
        while self.captured and now - self.captured[0]["time"] >= self.drawing:
            self.tell("media", self.captured.popleft())

    def act(self, now: float) -> None:
        """Do the next part of each action that runs."""
        actions = self.actions
        hold = 1.7 * HOLD if self.fault is Fault.ACTS_DRIVEN_ON else HOLD
        if actions.moving and now - actions.renewed > hold - TICK and self.fault is not Fault.ACTS_UNRENEWED:
            self.interrupt("not_renewed")
        for id, values in list(actions.values.items()):
            if id != actions.moving:
                self.light = values["on"]
                actions.ended(id, "done", self.event, now, text="on" if self.light else "off")
            elif math.hypot(*self.place) < NEAR:
                actions.ended(id, "done", self.event, now, text="at home")
                self.values = list(NEUTRAL)
            else:
                self.values = [min(max(-place, -HOMING_SPEED), HOMING_SPEED) for place in self.place]

    def interrupt(self, reason: str) -> None:
        """End the action that moves the robot, if one does."""
        if self.actions.moving:
            self.values = list(NEUTRAL)
        self.actions.interrupt(reason, self.event, time.monotonic())

    def picture(self, now: float) -> Message:
        stamp = event_after(self.event) if self.fault is Fault.STAMPS_AHEAD else self.event
        about = {"type": "media", "stream": "camera", "codec": "yuv420p", "width": 16, "height": 16}
        return {**about, "stamp": stamp, "time": now, "payload": PICTURE}

    @property
    def newest(self) -> Message:
        return self.issues[self.issue]

    def measured(self) -> Message:
        """The fields of a feedback that the robot measures."""
        return {"axes": self.values, "joints": self.place, "at_rest": self.values == NEUTRAL}

    def measure(self) -> None:
        """Issue the current event's feedback, once more."""
        self.issue += 1
        now = time.monotonic()
        nonce = secrets.randbelow(LARGEST) + 1
        self.issues[self.issue] = {
            "type": "feedback",
            "event": self.event,
            "issue": self.issue,
            "time": now,
            **self.measured(),
            "stop": self.stop,
            "nonce": nonce,
            "neutral_needed": self.neutral_needed,
        }
        self.actions.issued(nonce, now)
        self.tell("operator", self.newest)
        self.tell("events", {"type": "event", "event": self.event, "time": now})

    def tell(self, role: str, message: Message) -> None:
        for link in self.links:
            if link.role == role:
                link.send(message)

    # What clients say

    def take(self, link: Link, message: Message) -> None:
        match message["type"]:
            case "command":
                self.commanded(link, message)
            case "rest":
                self.rest(message)
            case "stop":
                number = self.press(message)
                link.send({"type": "stop_taken", "press": message["press"], "number": number, "kept": False})
            case "reset":
                if reason := self.reset(message):
                    self.refuse(link, reason, stop=message["number"])
            case "act":
                now, driven = time.monotonic(), self.values != NEUTRAL
                robot = RobotNow(now, self.event, self.stop["stopped"], self.neutral_needed, driven)
                self.actions.request(message, robot)
            case "action_cancel":
                if message["id"] in ("", self.actions.moving):
                    self.interrupt("cancelled")
                else:
                    self.actions.cancel(message["id"], self.event, time.monotonic())

    def refuse(self, link: Link, reason: str, event: int = 0, **more: Any) -> None:
        link.send({"type": "refusal", "event": event, "reason": reason, "current": self.event, **more})

    def commanded(self, link: Link, command: Message) -> None:
        if command["values"] != NEUTRAL and self.fault not in (Fault.ACTS_DRIVEN, Fault.ACTS_DRIVEN_ON):
            self.interrupt("driving")
        before = self.event
        self.command(link, command)
        if self.event != before and command["values"] == NEUTRAL:
            self.actions.renew(command["action"], time.monotonic())

    def command(self, link: Link, command: Message) -> None:
        reason = self.is_proper(command)
        if command["event"] == self.event and not reason:
            if self.fault is Fault.REPEATS_COUNT:
                self.execute({**command, "event": event_after(self.event)})
                return
            if self.fault is Fault.REPEATS_HOLD:
                self.executed, self.values = time.monotonic(), clamped(command)
            self.tell("operator", self.newest)
            return
        reason = reason or self.may_execute(command)
        if not reason:
            self.execute(command)
            return
        if self.fault is not Fault.REFUSES_SILENTLY:
            self.refuse(link, reason, command["event"])
        if reason == "late":
            self.measure()

    def is_proper(self, command: Message) -> str:
        if len(command["values"]) != len(NEUTRAL):
            return "wrong_size"
        numbers = [*command["values"], command["speed"]]
        if not (all(map(is_number, numbers)) and 0 <= command["speed"] <= 1) and self.fault is not Fault.NAN_EXECUTES:
            return "not_a_number"
        return "stopped" if self.stop["stopped"] else ""

    def may_execute(self, command: Message) -> str:
        if command["event"] != event_after(self.event):
            return "out_of_order"
        answered = self.issues.get(command["issue"])
        is_old = answered is not None and time.monotonic() - answered["time"] > AGE
        if answered is None or (is_old and self.fault is not Fault.LATE_EXECUTES):
            return "late"
        if command["nonce"] != answered["nonce"] and self.fault is not Fault.UNSEEN_EXECUTES:
            return "unseen"
        if command["values"] == NEUTRAL:
            return ""
        if self.voided and event_gap(command["event"], self.voided) <= 0:
            return "rested"
        return "not_neutral" if self.neutral_needed and self.fault is not Fault.NO_NEUTRAL else ""

    def execute(self, command: Message) -> None:
        self.executed = time.monotonic()
        if not self.actions.moving:
            self.values = clamped(command)
        if command["values"] == NEUTRAL:
            self.neutral_needed = False
            self.presses.clear()
        self.event, self.issue, self.issues = command["event"], 0, {}
        self.measure()

    def rest(self, rest: Message) -> None:
        following = event_after(self.event)
        if event_gap(self.event, rest["event"]) > 0 or self.fault is Fault.NO_REST:
            return
        self.interrupt("rested")
        self.values = list(NEUTRAL)
        named = following if event_gap(rest["event"], following) > 0 else rest["event"]
        if not self.voided or event_gap(named, self.voided) > 0:
            self.voided = named

    def press(self, stop: Message) -> int:
        known = self.presses.get(stop["press"])
        if stop["press"] and known is not None and self.fault is not Fault.NUMBERS_REPEATS:
            return known
        number: int = self.stop["number"] + 1
        first = self.stop if self.stop["stopped"] else stop
        about = {"by": first["by"], "reason": first["reason"], "press": stop["press"]}
        self.stop = {"stopped": True, "number": number, "kept": False, **about}
        self.presses[stop["press"]] = number
        if len(self.presses) > PRESSES:
            del self.presses[next(iter(self.presses))]
        self.interrupt("stopped")
        self.values, self.neutral_needed, self.stopped_at = list(NEUTRAL), True, time.monotonic()
        self.measure()
        return number

    def reset(self, reset: Message) -> str:
        if reset["number"] != self.stop["number"] and self.fault is not Fault.RESETS_ANY_STOP:
            return "stale_reset"
        if not self.stop["stopped"]:
            return ""
        if time.monotonic() - self.stopped_at < 1.0:
            return "too_soon"
        self.stop = released(self.stop)
        self.measure()
        return ""

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
            send(writer, {"type": "goodbye", "error": "silent"})
        except (ConnectionError, asyncio.IncompleteReadError):
            pass
        finally:
            if link is not None:
                self.lost(link)
            with contextlib.suppress(ConnectionError):
                writer.close()
                await writer.wait_closed()

    def lost(self, link: Link) -> None:
        self.links.discard(link)
        if link.role != "operator":
            return
        self.interrupt("link_down")
        self.values, self.neutral_needed = list(NEUTRAL), True
        if link.name and not link.left:
            self.reserved = link.name, time.monotonic() + GRACE

    async def admitted(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Link | None:
        payload = await self.payload(reader, writer, 8192)
        if payload is None:
            return None
        try:
            hello = read(payload)
        except Malformed:
            hello = {"type": "none"}
        if error := self.unwelcome(hello):
            send(writer, {"type": "goodbye", "error": error})
            return None
        link = Link(writer, hello["role"], hello["name"])
        described = None if link.role == "events" else self.description
        about = {"version": 2, "role": "robot", "epoch": self.epoch}
        link.send({"type": "hello", **about, "description": described})
        if link.role == "operator":
            self.neutral_needed, self.reserved = True, ("", 0.0)
            if self.fault is Fault.FORGETS_STOP:
                self.stop = released(self.stop)
            for state in self.actions.anew(time.monotonic()):
                link.send(state)
        self.links.add(link)
        self.measure()
        return link

    def unwelcome(self, hello: Message) -> str:
        """The error of the goodbye to this hello; "" for none."""
        if hello["type"] != "hello":
            return "handshake"
        if hello["version"] != 2 and self.fault is not Fault.ANY_VERSION:
            return "version"
        if hello["role"] not in ALLOWED:
            return "role"
        name, until = self.reserved
        is_taken = any(link.role == "operator" for link in self.links) and self.fault is not Fault.TWO_OPERATORS
        is_reserved = time.monotonic() < until and hello["name"] != name
        return "taken" if hello["role"] == "operator" and (is_taken or is_reserved) else ""

    async def heard(self, reader: asyncio.StreamReader, link: Link) -> bool:
        """One valid message; False when the link is over."""
        while (payload := await self.payload(reader, link.writer, 1 << 20)) is not None:
            try:
                message = read(payload)
            except Malformed:
                if self.fault is Fault.DIES_OF_MALFORMED:
                    for each in self.links:
                        each.writer.close()
                    return False
                self.refuse(link, "malformed")
                continue
            match message["type"]:
                case "goodbye":
                    link.left = message["error"] == "closing"
                    return False
                case "ping":
                    link.send({"type": "pong", "id": message["id"]})
                    return True
                case "pong":
                    return True
            if message["type"] in ALLOWED[link.role]:
                self.take(link, message)
                return True
            if self.fault is not Fault.ANY_ROLE:
                self.refuse(link, "not_allowed", message["event"] if message["type"] == "command" else 0)
        return False

    async def payload(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, bound: int) -> bytes | None:
        length = int.from_bytes(await reader.readexactly(4), "big")
        if not 0 < length <= bound and self.fault is not Fault.NO_BOUND:
            send(writer, {"type": "goodbye", "error": "framing"})
            return None
        return await reader.readexactly(length)


def is_number(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def clamped(command: Message) -> list[float]:
    """The values within the axes' limits."""
    return [min(max(value, -1.0), 1.0) for value in command["values"]]


def released(stop: Message) -> Message:
    return {"stopped": False, "number": stop["number"], "press": stop["press"], "kept": False}


def send(writer: asyncio.StreamWriter, message: Message) -> None:
    if not writer.is_closing():
        writer.write(frame(message))


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
