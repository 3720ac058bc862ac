"""What docs/robot-link.md promises of links, asked of the robot in C and of our own bridge alike."""

import asyncio
from random import Random

import pytest

from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import Command, Feedback, Goodbye, Hello, LinkMessage, Ping, Rest, encode_message
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.docs.examples.robots import Robot, moving
from tests.robot_bridge.bridge_helpers import operator, raw_link


async def test_unknown_fields_are_passed_over(robot: Robot) -> None:
    async with raw_link(robot, "operator") as link:
        link.writer.write(frame(b"\x83\xa4type\xa4stop\xa3new\x92\x81\x01\x90\xc0\xa2by\xa1x"))
        while (await link.find(Feedback)).stop.by != "x":
            pass


async def test_who_does_not_read_is_dropped_and_holds_nobody_up(robot: Robot) -> None:
    async with operator(robot) as driver:
        reader, writer = await asyncio.open_connection(*robot.address, limit=1024)
        try:
            writer.write(frame(encode_message(Hello(role="media"))))

            async def keep_alive() -> None:
                while True:
                    writer.write(frame(encode_message(Ping(id=1))))
                    await writer.drain()
                    await driver.drive(moving(driver))

            with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
                async with asyncio.timeout(20):
                    await keep_alive()
        finally:
            writer.close()
        await driver.drive(moving(driver))


async def test_more_links_than_there_is_room_for_are_turned_away_and_an_operator_always_has_room(robot: Robot) -> None:
    links = [RobotLink(*robot.address, "events") for _ in range(31)]
    try:
        for link in links:  # not all at once: more than 16 that nobody has admitted yet are too many
            await link.connect()
        with pytest.raises(LinkRefused, match="full"):
            await RobotLink(*robot.address, "events").connect()
        async with operator(robot) as driver:
            await driver.drive(moving(driver))
            with pytest.raises(LinkRefused, match="full"):
                await RobotLink(*robot.address, "events").connect()
    finally:
        await asyncio.gather(*(link.close() for link in links))
    async with operator(robot) as driver:
        await driver.drive(moving(driver))


def spoilt(random: Random) -> bytes:
    """A frame that was once a message; no stop, which might still be one."""
    whole: list[LinkMessage] = [
        Command(event=2, issue=1, values=[0.0, 0.0]),
        Rest(event=2),
        Ping(id=5),
        Hello(role="operator", name="x" * 20),
        Goodbye(error="closing", detail="ü" * 9),
    ]
    data = bytearray(encode_message(random.choice(whole)))
    for _ in range(random.randrange(1, 5)):
        match random.randrange(3):
            case 0:
                data[random.randrange(len(data))] = random.randrange(256)
            case 1:
                del data[random.randrange(len(data)) :]
                data += random.randbytes(random.randrange(1, 9))
            case 2:
                at = random.randrange(len(data))
                data[at:at] = random.randbytes(random.randrange(1, 5))
    return bytes(data)


async def test_hostile_bytes_disturb_nobody(robot: Robot) -> None:
    """With the sanitizers on, a byte read or written where there is none ends the robot in C."""
    random = Random(4)
    async with operator(robot) as driver:
        for _ in range(60):
            reader, writer = await asyncio.open_connection(*robot.address)
            if random.random() < 0.6:
                writer.write(frame(encode_message(Hello(role=random.choice(["events", "media"])))))
            for _ in range(30):
                writer.write(frame(spoilt(random)))
            if random.random() < 0.3:
                writer.write(random.randbytes(200))
            writer.close()
            await driver.drive([0.0] * len(driver.feedback.axes))
