"""Peers that misbehave, over real TCP: they are told why, and disturb nobody else."""

import asyncio
import socket
from contextlib import AsyncExitStack
from random import Random

import pytest

from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import (
    Feedback,
    Goodbye,
    Hello,
    LinkRole,
    Ping,
    Refusal,
    Reset,
    Rest,
    Stop,
    encode_message,
)
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import NEUTRAL, PATIENCE, RecordingRobot, operator, raw_link, running_bridge

ROLES: tuple[LinkRole, ...] = ("events", "media")


async def test_a_second_operator_is_told_that_the_place_is_taken_until_the_first_leaves() -> None:
    async with running_bridge() as bridge:
        async with operator(bridge) as driver:
            with pytest.raises(LinkRefused, match="taken"):
                await RobotLink(*bridge.address, "operator").connect()
            await driver.drive()
        async with operator(bridge) as successor:
            assert (await successor.drive()).event >= 5


async def test_a_silent_operator_is_dropped_and_makes_room_for_another() -> None:
    async with running_bridge() as bridge, raw_link(bridge, "operator") as silent:
        goodbye = await silent.find(Goodbye)
        assert goodbye.error == "silent"
        async with operator(bridge) as driver:
            await driver.drive()
        assert bridge.counters.endings["silent"] == 1


async def test_every_byte_may_come_alone() -> None:
    async with running_bridge() as bridge, raw_link(bridge) as link:
        for byte in frame(encode_message(Hello(role="operator"))) + frame(encode_message(Ping(id=1))):
            link.writer.write(bytes([byte]))
            await asyncio.sleep(0)
        hello = await link.find(Hello)
        assert (hello.role, hello.epoch) == ("robot", bridge.epoch)
        assert (await link.find(Feedback)).event == 1


async def test_malformed_messages_are_refused_counted_and_do_not_count_as_life() -> None:
    async with running_bridge() as bridge, raw_link(bridge, "operator") as link:
        link.writer.write(frame(b"\xc1"))
        refusal = await link.find(Refusal)
        assert (refusal.event, refusal.reason, refusal.current) == (0, "malformed", 1)
        goodbye = None
        while goodbye is None:
            link.writer.write(frame(b"\xc1"))
            message = await link.next()
            goodbye = message if isinstance(message, Goodbye) else None
        assert goodbye.error == "silent"
        assert bridge.counters.bad_input["malformed"] > 1
        assert bridge.counters.refusals["malformed"] == bridge.counters.bad_input["malformed"]


async def test_malformed_messages_do_not_keep_the_robot_moving() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        for _ in range(20):
            await driver.drive()
        assert abs(robot.state.vx) > 0.1
        wrong = driver.command([0.4])
        while robot.applied[-1][1] != NEUTRAL:
            assert (await driver.refused(wrong)).reason == "wrong_size"
        assert bridge.counters.refusals["wrong_size"] >= 1


async def test_an_oversized_frame_ends_only_the_link_that_sent_it() -> None:
    async with running_bridge() as bridge, operator(bridge) as driver, raw_link(bridge, "media") as link:
        link.writer.write(b"\xff\xff\xff\xff")
        assert (await link.find(Goodbye)).error == "framing"
        await driver.drive()
        assert bridge.counters.bad_input["framing"] == 1


async def test_a_role_cannot_do_what_it_must_not() -> None:
    async with running_bridge() as bridge, raw_link(bridge, "events") as link:
        link.send(Rest(event=1), Reset())
        assert (await link.find(Refusal)).reason == "not_allowed"
        assert bridge.counters.bad_input["not_allowed"] == 2


async def test_a_media_peer_that_does_not_read_is_dropped_and_disturbs_nobody() -> None:
    robot = RecordingRobot(media=True)
    async with running_bridge(robot) as bridge:
        greedy = socket.create_connection(bridge.address)
        greedy.setblocking(False)
        loop = asyncio.get_running_loop()
        try:
            await loop.sock_sendall(greedy, frame(encode_message(Hello(role="media"))))
            async with operator(bridge) as driver:
                slowest = 0.0
                while bridge.links > 1:
                    await loop.sock_sendall(greedy, frame(encode_message(Ping(id=1))))
                    started = loop.time()
                    await driver.drive()
                    slowest = max(slowest, loop.time() - started)
                assert bridge.counters.endings == {"lost": 1}
                assert bridge.counters.drops["overview"] > 5
                assert driver.feedback.event > 20
                assert slowest < 0.5
        finally:
            greedy.close()


async def test_whatever_bytes_strangers_send_the_operator_drives_on() -> None:
    """Four at a time: the robot that one of them has stopped answers by its refresh alone, twice a second."""
    random = Random(1)
    hello = frame(encode_message(Hello(role="media")))
    stop = frame(encode_message(Stop(by="x" * 40)))
    async with running_bridge() as bridge, operator(bridge) as driver:
        for first in range(0, 40, 4):
            async with AsyncExitStack() as strangers:
                for attempt in range(first, first + 4):
                    garbage = bytearray(hello + stop * 3 if attempt % 2 else random.randbytes(300))
                    for _ in range(3):
                        place = random.randrange(len(hello) if attempt % 4 == 1 else len(garbage))
                        garbage[place] = random.randrange(256)
                    stranger = await strangers.enter_async_context(raw_link(bridge))
                    stranger.writer.write(bytes(garbage))
                driver.link.send(driver.command())
                await driver.next(Feedback)
        await driver.reset()
        await driver.arm()
        await driver.drive()
        assert sum(bridge.counters.bad_input.values()) > 10


async def test_closing_does_not_wait_long_for_a_peer_that_does_not_read() -> None:
    robot = RecordingRobot(media=True)
    async with running_bridge(robot) as bridge:
        greedy = socket.create_connection(bridge.address)
        try:
            greedy.sendall(frame(encode_message(Hello(role="media"))))
            await robot.until(lambda: bridge.drops["overview"] > 0, "the peer is full")
            async with asyncio.timeout(PATIENCE):
                await bridge.close()
        finally:
            greedy.close()


async def test_however_many_links_others_open_the_place_of_the_operator_stays_free() -> None:
    async with Bridge(RecordingRobot(), BridgeSettings(port=0, max_links=3)) as bridge, AsyncExitStack() as others:
        for role in ROLES:
            await others.enter_async_context(raw_link(bridge, role))
        for _ in range(2):
            with pytest.raises(LinkRefused, match="full"):
                await RobotLink(*bridge.address, "media").connect()
            async with operator(bridge) as driver:
                await driver.drive()


async def test_more_links_than_the_bridge_takes_are_turned_away() -> None:
    async with Bridge(RecordingRobot(), BridgeSettings(port=0, max_links=1)) as bridge, operator(bridge) as driver:
        with pytest.raises(LinkRefused, match="full"):
            await RobotLink(*bridge.address, "media").connect()
        await driver.drive()
