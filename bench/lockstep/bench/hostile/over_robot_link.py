"""Attacks on a robot bridge that listens beyond loopback, by a client that knows its address and not its secret."""

import asyncio
import ssl
from contextlib import suppress
from random import Random

from lockstep.bench.hostile.target import Target

__all__ = ["bridge_handshakes", "bridge_silence"]

HELD = 20  # connections of one member at a time
SECONDS = 2.0


async def bridge_handshakes(target: Target, random: Random) -> None:
    """Make TLS handshakes, one after the other, and send nothing after them."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    with suppress(OSError, TimeoutError):
        async with asyncio.timeout(SECONDS):
            while True:
                _, writer = await asyncio.open_connection(*target.bridge, ssl=context)
                target.seen["handshakes"] += 1
                writer.transport.abort()


async def bridge_silence(target: Target, random: Random) -> None:
    """Open connections that send nothing, or a part of a TLS record."""
    writers = list[asyncio.StreamWriter]()
    try:
        for _ in range(HELD):
            _, writer = await asyncio.open_connection(*target.bridge)
            writers.append(writer)
            if random.random() < 0.5:
                writer.write(b"\x16\x03\x01\x02\x00" + random.randbytes(random.randrange(500)))
        await asyncio.sleep(SECONDS)
    finally:
        for writer in writers:
            writer.transport.abort()
