"""Cases about links: bytes, handshake, roles, heartbeats."""

import asyncio
from collections.abc import Awaitable

import msgspec

from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.framing import MAX_CONTROL_FRAME, MAX_HELLO_FRAME, frame
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import (
    PROTOCOL_VERSION,
    Command,
    EventNotice,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    Ping,
    Pong,
    Refusal,
    Reset,
    Rest,
    encode_message,
)
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.errors import Violation, expect
from lockstep.robot_bridge.conformance.peer import Peer
from lockstep.robot_bridge.conformance.subject import Subject, described, needs
from lockstep.robot_bridge.conformance.waiting import PATIENCE

__all__ = ["BAD_BEGINNINGS", "BAD_LENGTHS", "FORBIDDEN", "LINK_CASES", "MALFORMED"]

HELLO_TIMEOUT = 2.0  # s
SILENCE = 1.0  # s, on a short path
MOST_SILENCE = 5.0  # s, on any path
EARLY = 0.2  # s by which clocks and paths may shorten what is measured here
PINGS = 5
PING_SECONDS = 2.5  # in which so many pings come twice over
FAR_ID = 2**53 - 1  # of a ping: larger than any that this side's heartbeats use

# First bytes of a connection, and the error of the goodbye that answers them.
BAD_BEGINNINGS: tuple[tuple[str, bytes, str], ...] = (
    ("an empty frame", bytes(4), "framing"),
    ("a length of 4 GiB", b"\xff\xff\xff\xff", "framing"),
    ("a length beyond 8 KiB", (MAX_HELLO_FRAME + 1).to_bytes(4, "big"), "framing"),
    ("a frame that is not a message", frame(b"\xc1"), "handshake"),
    ("a ping instead of a hello", frame(encode_message(Ping(id=1))), "handshake"),
)

# The same on a link that was admitted.
BAD_LENGTHS: tuple[tuple[str, bytes], ...] = (
    ("an empty frame", bytes(4)),
    ("a length beyond 1 MiB", (MAX_CONTROL_FRAME + 1).to_bytes(4, "big")),
)

# Payloads of frames that are no messages. None moves or stops a robot that takes it for one after all.
MALFORMED: tuple[tuple[str, bytes], ...] = (
    ("an array", b"\x93\x01\x02\x03"),
    ("a map of 4 G entries", b"\xdf\xff\xff\xff\xff"),
    ("an unknown kind", b"\x81\xa4type\xa4none"),
    ("a command without fields", b"\x81\xa4type\xa7command"),
    ("bytes after the message", encode_message(Reset()) + b"\x00"),
    ("a string that is not UTF-8", b"\x82\xa4type\xa5reset\xa2by\xa2\xc3\x28"),
    ("a string of 501 characters", b"\x82\xa4type\xa5reset\xa2by\xda\x01\xf5" + b"x" * 501),
    ("a rest for event 0", b"\x82\xa4type\xa4rest\xa5event\x00"),
    ("a rest for event 2³¹", b"\x82\xa4type\xa4rest\xa5event\xce\x80\x00\x00\x00"),
    ("values that are a string", b"\x84\xa4type\xa7command\xa5event\x02\xa5issue\x01\xa6values\xa3abc"),
    ("issue 0", b"\x84\xa4type\xa7command\xa5event\x02\xa5issue\x00\xa6values\x90"),
)

FORBIDDEN: tuple[tuple[LinkRole, LinkMessage], ...] = (
    ("media", Command(event=2, issue=1, values=[])),
    ("media", Reset()),
    ("events", Rest(event=2)),
    ("events", Reset()),
    ("operator", Hello(role="operator")),
    ("operator", EventNotice(event=1, time=0.0)),
)


async def _hello(subject: Subject) -> None:
    async with subject.link("media") as (_, hello):
        expect(hello.version == PROTOCOL_VERSION, f"version {hello.version}, not {PROTOCOL_VERSION}")
        expect(hello.role == "robot", f"the role {hello.role!r}, not 'robot'")
        expect(hello.epoch != "", "no epoch")
    async with subject.link("events") as (_, again):
        expect(hello.epoch == again.epoch, "another epoch for another link, without a restart")


async def _description(subject: Subject) -> None:
    async with subject.link("media") as (_, hello):
        described(hello)


async def _first_feedback(subject: Subject) -> None:
    async with subject.operator(armed=False) as driver:  # which waits for it, and checks that it fits
        expect(driver.feedback.nonce != 0, "a nonce of 0")


async def _version(subject: Subject) -> None:
    async with subject.stranger() as peer:
        peer.send(Hello(role="events", version=PROTOCOL_VERSION - 1))
        await peer.ends("version")


async def _role(subject: Subject) -> None:
    async with subject.stranger() as peer:
        peer.send(Hello(role="robot"))
        await peer.ends("role")


async def _bad_beginnings(subject: Subject) -> None:
    async with subject.operator() as driver:
        for what, data, error in BAD_BEGINNINGS:
            async with subject.stranger() as peer:
                peer.write(data)
                await _told(what, peer.ends(error))
        await driver.drive(driver.neutral)


async def _hello_timeout(subject: Subject) -> None:
    loop = asyncio.get_running_loop()
    async with subject.stranger() as peer:
        began = loop.time()
        await peer.ends("silent", patience=HELLO_TIMEOUT + PATIENCE)
        lasted = loop.time() - began
        expect(lasted > HELLO_TIMEOUT - EARLY, f"the link ended after {lasted:.1f} s, not {HELLO_TIMEOUT:g} s")


async def _secret(subject: Subject) -> None:
    needs(subject.place.secret is not None, "no link secret was given")
    for what, secret in (("no", None), ("a wrong", LinkSecret.draw())):
        async with subject.stranger() as peer:
            try:
                await peer.hello("events", secret)
            except LinkRefused as error:
                expect(error.detail.startswith("unauthorised"), f"refused {error.detail!r}, not 'unauthorised'")
            else:
                raise Violation(f"a client with {what} secret was admitted")


async def _second_operator(subject: Subject) -> None:
    async with subject.operator() as driver:
        try:
            async with subject.link("operator"):
                raise Violation("a second operator was admitted beside the first")
        except LinkRefused as error:
            expect(error.detail.startswith("taken"), f"refused {error.detail!r}, not 'taken'")
        await driver.drive(driver.neutral)


async def _permissions(subject: Subject) -> None:
    for role, message in FORBIDDEN:
        async with subject.link(role) as (peer, _):
            peer.send(message)
            refusal = await peer.find(Refusal)
            kind = type(message).__name__.lower()
            expect(refusal.reason == "not_allowed", f"{kind} from {role}: {refusal.reason!r}, not 'not_allowed'")


async def _malformed(subject: Subject) -> None:
    async with subject.operator() as driver, subject.link("media") as (media, _):
        for peer in (driver.peer, media):
            for what, payload in MALFORMED:
                peer.write(frame(payload))
                await _told(what, _refused_malformed(peer))
        await driver.drive(driver.neutral)


async def _refused_malformed(peer: Peer) -> None:
    refusal = await peer.find(Refusal)
    expect(refusal.reason == "malformed", f"refused {refusal.reason!r}, not 'malformed'")


async def _unknown_fields(subject: Subject) -> None:
    async with subject.link("events") as (peer, _):
        peer.write(frame(msgspec.msgpack.encode({"type": "ping", "new": [{"a": None}], "id": FAR_ID})))
        await peer.find(Pong, lambda pong: pong.id == FAR_ID)


async def _lengths(subject: Subject) -> None:
    async with subject.operator() as driver:
        for what, data in BAD_LENGTHS:
            async with subject.link("events") as (peer, _):
                peer.write(data)
                await _told(what, peer.ends("framing"))
        await driver.drive(driver.neutral)


async def _heartbeats(subject: Subject) -> None:
    async with subject.link("events") as (peer, _):
        for number in (-77, FAR_ID):
            peer.send(Ping(id=number))
            expect((await peer.find(Pong)).id == number, "a pong has another id than its ping")
        count = await peer.pinged(PINGS, PING_SECONDS)
        expect(count >= PINGS, f"{count} pings in {PING_SECONDS:g} s")


async def _silent_link(subject: Subject) -> None:
    """Each notice, which comes every 0.5 s, is answered with bytes that are no message and no sign of life."""
    loop = asyncio.get_running_loop()
    async with subject.link("events") as (peer, _):
        peer.heartbeat.beats = False
        began, longest = loop.time(), MOST_SILENCE + PATIENCE / 2
        while True:
            said = await peer.next(longest)
            lasted = loop.time() - began
            if isinstance(said, Goodbye):
                expect(said.error == "silent", f"the link ended with {said.error!r}, not 'silent'")
                expect(lasted > SILENCE - EARLY, f"the link ended after {lasted:.1f} s; {SILENCE:g} s had to pass")
                return
            expect(said is not None, "the connection ended without a goodbye")
            expect(lasted < longest, f"nothing but malformed bytes for {lasted:.0f} s, and the link is still open")
            peer.write(frame(MALFORMED[0][1]))


async def _events_role(subject: Subject) -> None:
    async with subject.operator() as driver, subject.link("events") as (peer, hello):
        expect(hello.description is None, "the hello to a client of role events carries the description")
        event = (await driver.drive(driver.neutral)).event
        notice = await peer.find(EventNotice, lambda notice: notice.event == event)
        again = await peer.find(EventNotice, lambda notice: notice.event == event)
        expect(again.time > notice.time, "a refreshed feedback's notice has the time of the one before")


async def _told(what: str, result: Awaitable[None]) -> None:
    """Await, and say of what a violation is."""
    try:
        await result
    except Violation as error:
        raise Violation(f"{what}: {error}") from error


LINK_CASES: tuple[Case, ...] = (
    Case("hello", "a hello is answered with role robot, version 2 and one epoch", "Handshake and roles", _hello),
    Case("description", "the description makes sense", "The robot description", _description),
    Case(
        "first_feedback",
        "a feedback that fits the description comes soon after an operator link opens",
        "Handshake and roles",
        _first_feedback,
    ),
    Case("version", "a client of another version gets goodbye with version", "Goodbyes", _version),
    Case("role", "a client cannot be the robot", "Goodbyes", _role),
    Case(
        "bad_beginnings",
        "a first frame that is empty, too long or no hello ends its connection and no other",
        "Bytes",
        _bad_beginnings,
    ),
    Case("hello_timeout", "a client that sends no hello within 2 s gets silent", "Handshake and roles", _hello_timeout),
    Case("secret", "a client that does not prove the secret gets unauthorised", "The secret", _secret),
    Case("second_operator", "one operator at a time; another gets taken", "Handshake and roles", _second_operator),
    Case("permissions", "a message that its role does not permit is refused", "Handshake and roles", _permissions),
    Case("malformed", "malformed messages and unknown kinds are refused, and no link ends", "Errors", _malformed),
    Case("unknown_fields", "unknown fields are ignored", "Bytes", _unknown_fields),
    Case("lengths", "a length of 0 or beyond the bound ends its link and no other", "Bytes", _lengths),
    Case("heartbeats", "a ping every 0.2 s; each ping is answered with its id", "Heartbeats", _heartbeats),
    Case("silent_link", "a link without a valid message for 1 s ends", "Heartbeats", _silent_link),
    Case(
        "events_role",
        "event subscribers hear of every issue, and get no description",
        "Handshake and roles",
        _events_role,
    ),
)
