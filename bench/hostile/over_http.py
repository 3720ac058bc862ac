"""What can be done to a console with TCP and HTTP."""

import asyncio
from random import Random

from bench.hostile.target import Target

__all__ = ["forged_tokens", "garbage_bytes", "giant_offers", "many_requests", "slow_requests"]

SLOW_SECONDS = 3.0  # that one slow request is held
SDP = "application/sdp"


async def garbage_bytes(target: Target, random: Random) -> None:
    """What is no HTTP, or only begins like it."""
    reader, writer = await asyncio.open_connection(*target.address)
    try:
        beginning = random.choice((b"", b"GET / HTTP/1.1\r\n", b"POST /whep HTTP/1.1\r\nContent-Length: -1\r\n\r\n"))
        writer.write(beginning + random.randbytes(random.randrange(1, 4000)) + b"\r\n\r\n")
        async with asyncio.timeout(1):
            await reader.read(4096)
        target.seen["answered"] += 1
    finally:
        writer.transport.abort()


async def slow_requests(target: Target, random: Random) -> None:
    """A head or a body that does not end, a byte at a time."""
    _, writer = await asyncio.open_connection(*target.address)
    try:
        writer.write(b"POST /api/stop HTTP/1.1\r\nHost: localhost\r\n")
        if random.random() < 0.5:
            writer.write(b"Content-Length: 1000\r\n\r\n")
        for _ in range(10):
            writer.write(b"X")
            await asyncio.sleep(SLOW_SECONDS / 10)
    finally:
        writer.transport.abort()


async def forged_tokens(target: Target, random: Random) -> None:
    """Guessing, and tokens with a part replaced."""
    head, _, rest = target.token.partition(".")
    forged = random.choice((random.randbytes(20).hex(), f"{head}.{rest[::-1]}", target.token[:-2] + "xx", "x" * 5000))
    answer = await target.http.get("/api/session", headers={"Authorization": f"Bearer {forged}"})
    target.note(answer)


async def many_requests(target: Target, random: Random) -> None:
    """As many as one can ask for at once, of what costs the console something."""
    paths = [random.choice(("/api/session", "/api/invitations", "/metrics", "/")) for _ in range(20)]
    await asyncio.gather(*(target.ask("GET", path) for path in paths))


async def giant_offers(target: Target, random: Random) -> None:
    """Offers beyond every bound, and some just within."""
    candidate = "a=candidate:1 1 udp 1 192.0.2.1 {} typ host\r\n"
    section = "m=video 9 UDP/TLS/RTP/SAVPF 96\r\na=mid:{}\r\n"
    text = random.choice(
        (
            "v=0\r\n" + "".join(candidate.format(port) for port in range(1300)),
            "v=0\r\n" + "".join(section.format(number) for number in range(1200)),
            "x" * 200_000,
        )
    )
    await target.ask("POST", "/whep", text, **{"Content-Type": SDP})
