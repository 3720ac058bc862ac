"""Attacks on a console by TCP and HTTP."""

import asyncio
from random import Random

from lockstep.bench.hostile.target import Target

__all__ = [
    "address_flood",
    "body_holders",
    "forged_tokens",
    "garbage_bytes",
    "giant_offers",
    "health_flood",
    "many_requests",
    "non_readers",
    "recordings_reader",
    "scene_flood",
    "silent_connections",
    "slow_posts",
    "slow_requests",
    "stop_flood",
]

SLOW_SECONDS = 3.0  # for which one slow request is held
HELD_SECONDS = 15.0  # for which connections are held that do nothing
HELD = 20  # connections held at a time
FLOOD = 50  # requests on one connection
SDP = "application/sdp"


async def garbage_bytes(target: Target, random: Random) -> None:
    """Send data that is not HTTP, or only begins like it."""
    reader, writer = await target.connect()
    try:
        beginning = random.choice((b"", b"GET / HTTP/1.1\r\n", b"POST /whep HTTP/1.1\r\nContent-Length: -1\r\n\r\n"))
        writer.write(beginning + random.randbytes(random.randrange(1, 4000)) + b"\r\n\r\n")
        async with asyncio.timeout(1):
            await reader.read(4096)
        target.seen["answered"] += 1
    finally:
        writer.transport.abort()


async def slow_requests(target: Target, random: Random) -> None:
    """Send a head or a body that does not end, a byte at a time."""
    _, writer = await target.connect()
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
    """Guess tokens, and send tokens with a part replaced."""
    head, _, rest = target.token.partition(".")
    forged = random.choice((random.randbytes(20).hex(), f"{head}.{rest[::-1]}", target.token[:-2] + "xx", "x" * 5000))
    answer = await target.http.get("/api/session", headers={"Authorization": f"Bearer {forged}"})
    target.note(answer)


async def many_requests(target: Target, random: Random) -> None:
    """Ask at once, as often as possible, for responses that are costly for the console."""
    paths = [random.choice(("/api/session", "/api/invitations", "/metrics", "/")) for _ in range(20)]
    await asyncio.gather(*(target.ask("GET", path) for path in paths))


async def giant_offers(target: Target, random: Random) -> None:
    """Send offers beyond every bound, and some just within."""
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


async def scene_flood(target: Target, random: Random) -> None:
    """Ask for the 3D scene's page without a token."""
    await _flood(target, b"GET /scene/x HTTP/1.1\r\nHost: localhost\r\n\r\n")


async def stop_flood(target: Target, random: Random) -> None:
    """Press STOP without a token."""
    await _flood(target, b"POST /api/stop HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n")


async def health_flood(target: Target, random: Random) -> None:
    await _flood(target, b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")


async def address_flood(target: Target, random: Random) -> None:
    """Send far more requests than an address may, so that most are refused."""
    await _flood(target, b"GET /api/session HTTP/1.1\r\nHost: localhost\r\n\r\n")


async def _flood(target: Target, request: bytes) -> None:
    """Send one request after the other on one connection, until it is closed."""
    reader, writer = await target.connect()
    try:
        for _ in range(FLOOD):
            writer.write(request)
            await writer.drain()
            async with asyncio.timeout(SLOW_SECONDS):
                answer = await reader.read(65_536)
            if not answer:
                target.seen["closed"] += 1
                return
            target.seen[answer[9:12].decode(errors="replace")] += 1
    finally:
        writer.transport.abort()


async def body_holders(target: Target, random: Random) -> None:
    """Send single bytes of the announced body at intervals after the answer has come."""
    await _hold(target, b"POST /api/stop HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n")


async def slow_posts(target: Target, random: Random) -> None:
    """Send a good token, and no body. (That of a STOP would not be waited for: it is a stop.)"""
    head = f"POST /whep HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {target.token}\r\n"
    await _hold(target, head.encode() + f"Content-Type: {SDP}\r\nContent-Length: 1000\r\n\r\n".encode())


async def silent_connections(target: Target, random: Random) -> None:
    """Open TCP connections and send nothing: with TLS, a handshake that does not begin."""
    opened = [await asyncio.open_connection(*target.address) for _ in range(HELD)]
    await _until_closed(target, opened, b"")


async def non_readers(target: Target, random: Random) -> None:
    """Ask for much and read nothing of it."""
    opened = [await target.connect() for _ in range(HELD)]
    for reader, writer in opened:
        reader.set_exception(ConnectionError("not read"))
        writer.transport.pause_reading()  # type: ignore[attr-defined]
        writer.write(b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n" * 100)
    await asyncio.sleep(HELD_SECONDS)
    for _, writer in opened:
        writer.transport.abort()


async def _hold(target: Target, beginning: bytes) -> None:
    opened = [await target.connect() for _ in range(HELD)]
    for _, writer in opened:
        writer.write(beginning)
    await _until_closed(target, opened, b" ")


async def _until_closed(
    target: Target, opened: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]], byte: bytes
) -> None:
    """Send a byte a second on each connection, for a while."""
    try:
        for _ in range(int(HELD_SECONDS)):
            await asyncio.sleep(1)
            for _, writer in opened:
                if byte and not writer.is_closing():
                    writer.write(byte)
        target.seen["closed"] += sum(reader.at_eof() or writer.is_closing() for reader, writer in opened)
    finally:
        for _, writer in opened:
            writer.transport.abort()


async def recordings_reader(target: Target, random: Random) -> None:
    """Read the list of recordings with a good token, four at a time."""
    request = f"GET /api/recordings HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {target.token}\r\n\r\n"
    await asyncio.gather(*(_flood(target, request.encode()) for _ in range(4)))
