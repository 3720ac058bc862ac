"""Measures the cost of a Janus for one packet to one observer: `python -m lockstep.bench.relay.packets HOST`.

HOST is an address of this machine, not loopback. One publisher of noise sends 400 packets a second; 1, 6, then 12
subscribers count the packets of their sockets. The cost is the slope, without the fixed cost of a Janus.
"""

import asyncio
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from prometheus_client import CollectorRegistry

from lockstep.bench.harness.processes import Running, started
from lockstep.bench.relay.janus import JANUS_READY, janus_command
from lockstep.client.transport.sfu_media import RelayMedia, RelayTicket
from lockstep.protocol.description import Camera, RobotDescription
from lockstep.protocol.messages import Media
from lockstep.rtc.addresses import Path as NetworkPath
from lockstep.rtc.demux import DatagramKind, datagram_kind
from lockstep.rtc.endpoint import Connection, Endpoint
from lockstep.server.media.hub import MediaHub, MediaSettings
from lockstep.server.sfu.janus_publishing import publish
from lockstep.server.sfu.janus_room import JanusRoom, RoomKeys
from lockstep.server.sfu.janus_session import open_janus
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["main"]

PORT, ROOM, FEED = 8197, 1, 77
WIDTH, HEIGHT, RATE = 320, 240, 25.0
STEPS, SECONDS = (1, 6, 12), 12.0
KEYS = RoomKeys("", "secret", "publisher", "pin")


async def feed(hub: MediaHub, camera: str) -> None:
    """Feed pictures that no encoder can make small."""
    noise, began, stamp = np.random.default_rng(1), time.monotonic(), 0
    while True:
        stamp += 1
        payload = noise.integers(0, 255, WIDTH * HEIGHT * 3 // 2, dtype=np.uint8).tobytes()
        now = time.monotonic()
        picture = Media(
            stream=camera, codec="yuv420p", stamp=stamp, time=now - began, payload=payload, width=WIDTH, height=HEIGHT
        )
        hub.feed(picture, now)
        await asyncio.sleep(1 / RATE)


async def subscribe(ticket: RelayTicket, counts: list[int]) -> RelayMedia:
    media = RelayMedia(ticket, lambda _: None)
    await media.negotiate()
    peer: Any = media.connection.peer
    pass_on = peer.receive_datagram

    def take(data: bytes, path: NetworkPath, now: float) -> None:
        if datagram_kind(data) is DatagramKind.RTP:
            counts[0] += 1
        else:
            pass_on(data, path, now)

    peer.receive_datagram = take
    await media.connect()
    return media


class _Connect:
    """The part of the console's endpoint that publishing needs."""

    def __init__(self, endpoint: Endpoint) -> None:
        self._endpoint = endpoint

    async def connect(self, *, controlling: bool) -> Connection:
        return self._endpoint.connect(controlling=controlling)


async def measure(host: str, janus: Running) -> list[tuple[int, float]]:
    """Return packets and seconds of processor time, for each number of subscribers."""
    camera = Camera(name="noise", label="Noise", width=WIDTH, height=HEIGHT, frame_rate=RATE)
    hub = MediaHub(MediaSettings(), CollectorRegistry())
    hub.configure(RobotDescription(name="noise", label="Noise", axes=(), cameras=(camera,)))
    url, counts, found = f"ws://{host}:{PORT}", [0], []
    watchers: list[RelayMedia] = []
    async with (
        Endpoint([host]) as endpoint,
        open_janus(url) as session,
        publish(session, lambda each: JanusRoom(each, ROOM, KEYS), _Connect(endpoint), hub, FEED, "VP8") as publication,
    ):
        ticket = RelayTicket(
            engine="janus", relay="0", url=url, room=ROOM, pin=KEYS.pin, feed=FEED, streams=publication.streams
        )
        async with background_tasks(hub.run(), feed(hub, camera.name), _talk(publication)):
            for step in STEPS:
                while len(watchers) < step:
                    watchers.append(await subscribe(ticket, counts))
                await asyncio.sleep(2.0)
                before, used = counts[0], janus.usage.cpu_seconds()
                await asyncio.sleep(SECONDS)
                found.append((counts[0] - before, janus.usage.cpu_seconds() - used))
                print(f"{step} subscribers: {found[-1][0]} packets, {found[-1][1]:.2f} s of processor", flush=True)
        for watcher in watchers:
            await watcher.close()
    return found


async def _talk(publication: Any) -> None:
    while True:
        publication.send_feedback("{}")
        await asyncio.sleep(0.2)


async def run(host: str) -> None:
    with TemporaryDirectory() as folder:
        async with started(janus_command(Path(folder), host, PORT)) as janus:
            await janus.line(JANUS_READY)
            found = await measure(host, janus)
    packets, seconds = found[-1][0] - found[0][0], found[-1][1] - found[0][1]
    print(f"{seconds / packets * 1e6:.1f} µs a packet")


def main() -> None:
    asyncio.run(run(sys.argv[1]))


if __name__ == "__main__":
    main()
