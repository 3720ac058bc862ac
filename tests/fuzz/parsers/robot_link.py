"""What the robot link must withstand, as one function of bytes.

The first byte chooses the scene and how the rest is cut into reads; the rest is what arrives. The bridge is the real
one, with the real links, cores and limits, on a fake clock and without sockets.

Whatever arrives: nothing is raised, no more is kept than the bounds say, the event reference goes on by one per
executed command, the applied values keep to range and slew, `hold` after the last executed command the robot is at
rest, and a link on which nothing valid comes ends as silent.
"""

import asyncio
import contextlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import cast

from lockstep.protocol.errors import MessageError
from lockstep.protocol.framing import MAX_CONTROL_FRAME, MAX_HELLO_FRAME, MAX_MEDIA_FRAME, frame
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import (
    Command,
    Hello,
    LinkMessage,
    LinkRole,
    Ping,
    Pong,
    Reset,
    Rest,
    Stop,
    decode_message,
    encode_message,
)
from lockstep.protocol.serial import event_after, event_gap
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.admission.link_acceptor import LinkAcceptor
from lockstep.robot_bridge.link.heartbeats import SILENCE
from lockstep.robot_bridge.link.link_server import LinkPeer
from lockstep.robot_bridge.link.link_session import HELLO_TIMEOUT, ClientSession
from lockstep.robot_bridge.link.link_transport import TICK_INTERVAL
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from lockstep.robot_bridge.settings import BridgeSettings

__all__ = ["SCENES", "try_input"]

SECRET = LinkSecret("only for the fuzzer, which does not know it")
REST = [0.0, 0.0, 0.0]
FROM_CLIENT = (Command, Rest, Stop, Reset, Ping, Pong)
TICK = 0.02  # s: slower than the robot's own, for more inputs a second
MOST_READS = 40  # one a tick, which ends before a handshake takes too long


class Rig:
    """A bridge that ticks when told to, and its clock."""

    def __init__(self, monotonic: Callable[[], float], secret: LinkSecret | None = None) -> None:
        self.clock = monotonic
        self.robot = Watched()
        self.bridge = Bridge(self.robot, BridgeSettings(secret=secret), monotonic)
        self.links = self.bridge._links
        self.links._acceptor = cast(LinkAcceptor, self)  # it listens, as far as newcomers can tell
        self.bridge._feedback.issue()
        self.executed_at = float("-inf")

    def admitted(self, address: str) -> None:
        """As the acceptor is told; nobody waits here."""

    def connect(self) -> LinkPeer:
        peer = LinkPeer(self.links, self.clock, self.bridge._settings.secret)
        peer.connection_made(Wire())
        return peer

    def hear(self, peer: LinkPeer, data: bytes) -> None:
        """One read, as the event loop would deliver it."""
        before, executed = self.bridge.event, self.bridge.counters.executed
        if peer.session.ended is None:
            peer.data_received(data)
        new = self.bridge.counters.executed - executed
        if new:
            self.executed_at = self.clock()
        check(new <= 1 or self.bridge.event != before, "more than one event executed without a feedback")

    def tick(self, now: float) -> None:
        before, executed = self.bridge.event, self.bridge._core.pending
        self.bridge._ticks.tick()
        gap = event_gap(self.bridge.event, before)
        check(gap == (0 if executed is None else 1), f"the event reference went on by {gap}")
        for peer in list(self.links._connections):
            peer.tick()
        if now - self.executed_at > self.bridge.description.hold + 2 * TICK:
            check(self.robot.applied == REST, "the robot moves on after hold")


class Watched(PlanarRobot):
    """Checks what is applied against the description."""

    tick_seconds = TICK

    def __init__(self) -> None:
        super().__init__()
        self.applied = list(REST)

    def apply(self, values: Sequence[float]) -> None:
        for axis, before, after in zip(self.describe().axes, self.applied, values, strict=True):
            check(axis.minimum <= after <= axis.maximum, f"{axis.name} is out of range: {after}")
            steepest = max(axis.slew, axis.brake) * self.tick_seconds
            check(abs(after - before) <= steepest + 1e-9, f"{axis.name} jumps from {before} to {after}")
        self.applied = list(values)
        super().apply(values)


class Wire(asyncio.Transport):
    """A connection that takes everything and keeps nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.closing = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        pass

    def get_write_buffer_size(self) -> int:
        return 0

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        pass

    def close(self) -> None:
        self.closing = True

    abort = close


class Clock:
    """Stands for `time.monotonic` while one input is tried."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Broken(Exception):
    """A promise does not hold."""


def check(holds: bool, promise: str) -> None:
    if not holds:
        raise Broken(promise)


def wire(*messages: LinkMessage) -> bytes:
    return b"".join(frame(encode_message(message)) for message in messages)


def reads(data: bytes, code: int) -> list[bytes]:
    """All at once, or in pieces of 1, 3, 17 or 300 bytes, longer ones if they would be too many."""
    size = (len(data) or 1, 1, 3, 17, 300)[code % 5]
    size = max(size, -(-len(data) // MOST_READS))
    return [data[start : start + size] for start in range(0, len(data), size)]


def play(rig: Rig, clock: Clock, peer: LinkPeer, data: bytes, code: int, bound: int) -> None:
    """Let the bytes arrive and time pass, until well after hold."""
    for piece in reads(data, code):
        rig.hear(peer, piece)
        kept = len(peer.session._reader._buffer)
        check(kept <= bound + 4 + len(piece), f"{kept} bytes are kept")
        clock.now += TICK
        rig.tick(clock.now)
    for _ in range(24):
        clock.now += TICK
        rig.tick(clock.now)
    check(rig.robot.applied == REST, "the robot does not come to rest")
    for _ in range(round(HELLO_TIMEOUT / TICK_INTERVAL)):
        clock.now += TICK_INTERVAL
        peer.tick()
    check(peer.session.ended is not None, "a link on which nothing comes lives on")


def messages(data: bytes) -> Iterator[LinkMessage]:
    """What can be read of it, read here once more."""
    start = 0
    while start + 4 <= len(data):
        length = int.from_bytes(data[start : start + 4], "big")
        if not 0 < length <= len(data) - start - 4:
            return
        with contextlib.suppress(MessageError):
            yield decode_message(data[start + 4 : start + 4 + length])
        start += 4 + length


def stranger(clock: Clock, data: bytes, code: int) -> None:
    """Somebody else sends while the operator has let the robot move: it moves no longer for that."""
    rig = Rig(clock)
    operator = rig.connect()
    rig.hear(operator, wire(Hello(role="operator")))
    for values in (REST, [0.4, 0.2, 0.5]):
        clock.now += TICK
        rig.tick(clock.now)
        seen = rig.bridge._core.feedback
        assert seen is not None  # the bridge has issued one
        rig.hear(
            operator, wire(Command(event=event_after(seen.event), issue=seen.issue, nonce=seen.nonce, values=values))
        )
    check(rig.bridge.counters.executed == 2, "the operator could not drive")
    play(rig, clock, rig.connect(), data, code, MAX_CONTROL_FRAME)
    check(rig.bridge.counters.executed == 2, "a stranger drove")


def without_the_secret(clock: Clock, data: bytes, code: int) -> None:
    """Nothing that is sent without the secret is listened to, and little of it is kept."""
    rig = Rig(clock, SECRET)
    peer = rig.connect()
    play(rig, clock, peer, data, code, MAX_HELLO_FRAME)
    check(peer.session.role is None, "somebody without the secret was admitted")
    check(rig.bridge.event == 1 and not rig.bridge._core.stops.state.stopped, "somebody without the secret was heard")


def hostile_operator(clock: Clock, data: bytes, code: int) -> None:
    """Who is admitted as operator can drive, within all rules."""
    rig = Rig(clock)
    peer = rig.connect()
    rig.hear(peer, wire(Hello(role="operator")))
    play(rig, clock, peer, data, code, MAX_CONTROL_FRAME)
    sound = [each for each in messages(data) if isinstance(each, Command) and is_sound(each)]
    check(rig.bridge.counters.executed <= len(sound), "a command executed that is none")


def is_sound(command: Command) -> bool:
    return len(command.values) == len(REST) and all(
        value is not None and math.isfinite(value) for value in command.values
    )


def trickle(clock: Clock, data: bytes, code: int) -> None:
    """An operator link on which the same comes again and again lives only by what is valid."""
    rig = Rig(clock)
    peer = rig.connect()
    rig.hear(peer, wire(Hello(role="operator")))
    times = round(SILENCE / TICK_INTERVAL) + 4
    for _ in range(times):
        rig.hear(peer, data)
        for _ in range(math.ceil(TICK_INTERVAL / TICK)):
            clock.now += TICK
            rig.tick(clock.now)
    lives = any(isinstance(each, FROM_CLIENT) for each in messages(data * times))
    check(peer.session.ended is not None or lives, "malformed bytes keep a link alive")


def hostile_bridge(clock: Clock, data: bytes, code: int) -> None:
    """The other direction: a client that hears nonsense."""
    roles: tuple[LinkRole, ...] = ("operator", "events", "media")
    session = ClientSession(clock.now, roles[code % 3], "fuzz", SECRET if code % 2 else None)
    for piece in reads(data, code):
        session.take_outgoing()
        session.receive(piece, clock.now)
        check(len(session._reader._buffer) <= MAX_MEDIA_FRAME + 4 + len(piece), "too much is kept")
        session.tick(clock.now)


SCENES = (stranger, without_the_secret, hostile_operator, trickle, hostile_bridge)


def try_input(data: bytes) -> None:
    """Raises whatever goes wrong."""
    clock, real = Clock(), time.monotonic
    code = data[0] if data else 0
    time.monotonic = clock
    try:
        SCENES[code % len(SCENES)](clock, data[1:], code // len(SCENES))
    finally:
        time.monotonic = real
